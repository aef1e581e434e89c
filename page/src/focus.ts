// Where the focus goes when the part of the page that had it is gone: never nowhere, where keys are lost.
import { useLayoutEffect } from "preact/hooks";

export const picture = () => document.querySelector<HTMLElement>(".stage canvas, .stage svg.top");

export function focusBack(before: Element | null): void {
  if (document.activeElement && document.activeElement !== document.body) return;
  (before?.isConnected && before !== document.body ? (before as HTMLElement) : picture())?.focus();
}

/** Once the part is gone, what had the focus before it has it again. */
export function useFocusBack(): void {
  useLayoutEffect(() => {
    const before = document.activeElement;
    return () => requestAnimationFrame(() => focusBack(before)); // the page below may be out of reach until then
  }, []);
}
