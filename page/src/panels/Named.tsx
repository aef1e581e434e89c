// Names of objects in formulas: each lights its object, and is lit with it.
import { lit, spec } from "../state";

const WORD = /([A-Za-z_]\w*(?:\[\w+\])?)/;

/** The object of a name; of `can[i]`, which stands for several, none. */
function objectOf(word: string): string | null {
  return spec.value?.objects.some((one) => one.name === word) ? word : null;
}

/** Whether a formula is about an object: by its name, or as one of `can[i]`. */
export function mentions(formula: string, name: string): boolean {
  const base = name.match(/^(\w+)\[\d+\]$/)?.[1];
  return formula.split(WORD).some((word) => word === name || (base !== undefined && new RegExp(`^${base}\\[[a-z]\\w*\\]$`, "i").test(word)));
}

export function Named({ children }: { children: string }) {
  return <>{children.split(WORD).map((word, k) => (k % 2 && objectOf(word) ? <span key={k} class={`named${lit.value === word ? " lit" : ""}`} data-object={word}>{word}</span> : word))}</>;
}

/** Light the object whose name is under the pointer. */
export function lightWord(event: MouseEvent): void {
  lit.value = (event.target as HTMLElement).closest<HTMLElement>("[data-object]")?.dataset.object ?? null;
}
