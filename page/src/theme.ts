// Light or dark: as the system has it, until somebody chooses.
import { effect, signal } from "@preact/signals";

const KEPT = "scenegen.theme";
const dark = matchMedia("(prefers-color-scheme: dark)");

function kept(): string | null {
  try {
    return localStorage.getItem(KEPT);
  } catch {
    return null;
  }
}

export const theme = signal<"light" | "dark">((kept() ?? (dark.matches ? "dark" : "light")) === "dark" ? "dark" : "light");
dark.addEventListener("change", () => kept() || (theme.value = dark.matches ? "dark" : "light"));
effect(() => {
  document.documentElement.dataset.theme = theme.value;
});

export function toggleTheme(): void {
  theme.value = theme.value === "dark" ? "light" : "dark";
  try {
    localStorage.setItem(KEPT, theme.value);
  } catch {
    /* it holds until the page is left */
  }
}
