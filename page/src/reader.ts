// Texts beside the spec: what a code means, and files in which something is defined. They are only read.
import { signal } from "@preact/signals";
import { http } from "./server";
import { message } from "./state";

export interface Explained {
  code: string;
  severity: string;
  means: string;
  example: string;
  mended: string;
}

/** A code that is explained; `pinned` where it stays until it is closed. */
export const explained = signal<(Explained & { pinned: boolean }) | null>(null);

const texts = new Map<string, Promise<Explained>>();
let wanted = "";

export async function explainCode(code: string, pinned: boolean): Promise<void> {
  wanted = code;
  if (!texts.has(code)) {
    const found = http(`/api/explain?code=${encodeURIComponent(code)}`).then((answer) => answer.json());
    found.catch(() => texts.delete(code));
    texts.set(code, found);
  }
  try {
    const found = await texts.get(code)!;
    if (wanted === code) explained.value = { ...found, pinned: pinned || (explained.value?.code === code && explained.value.pinned) };
  } catch (error) {
    message.value = error instanceof Error ? error.message : String(error);
  }
}

/** The pointer has left a code: what was only looked at goes. */
export function leaveCode(): void {
  wanted = explained.value?.pinned ? explained.value.code : "";
  if (!explained.value?.pinned) explained.value = null;
}

export function closeCode(): void {
  wanted = "";
  explained.value = null;
}

/** A file that is read: `path` in the folder, or null for the prelude; what is defined stands in the lines `from` to `to`. */
export interface Reading {
  name: string;
  path: string | null;
  text: string;
  from: { line: number; character: number };
  to: { line: number; character: number };
}
export const reading = signal<Reading | null>(null);

export async function read(place: { name: string; path: string | null; prelude: boolean; range: { start: Reading["from"]; end: Reading["to"] } }): Promise<void> {
  const { name, path, prelude, range } = place;
  if (path === null && !prelude) {
    message.value = `defined in ${name}, which lies outside the folder that was opened`;
    return;
  }
  try {
    const answer = await http(path === null ? "/api/prelude" : `/api/file?path=${encodeURIComponent(path)}`);
    reading.value = { name, path, text: (await answer.json()).text, from: range.start, to: range.end };
  } catch (error) {
    message.value = error instanceof Error ? error.message : String(error);
  }
}
