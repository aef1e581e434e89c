// The command line that makes the same scenes.
import { alone, boot, request, saved, spec, unsaved } from "./state";
import type { Ends, Pose } from "./types";

function quoted(word: string): string {
  return /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replace(/'/g, `'\\''`)}'`;
}

function range([low, high]: Ends): string {
  return `${low ?? ""}:${high ?? ""}`;
}

export function command(): string {
  if (alone) return alone.command;
  const { phi, n, seed, method, spread, fix } = request.value;
  const file = method === "model" && boot.model ? boot.model : (saved.value.path ?? (unsaved.value ? "my.spec" : saved.value.name));
  const words = ["scenegen", "sample", quoted(file)];
  for (const [name, ends] of Object.entries(phi))
    if (ends[0] !== null || ends[1] !== null) words.push("--phi", quoted(`${name}=${range(ends)}`));
  words.push("-n", String(n), "--seed", String(seed));
  if (method !== "auto" && method !== "model") words.push("--method", method);
  if (spread !== "flat") words.push("--spread", spread);
  for (const { name, now, assets } of spec.value?.numbers ?? []) words.push("--count", quoted(`${name}=${assets[now - 1] ?? now}`));
  for (const [name, pose] of Object.entries(fix) as [string, Pose][]) words.push("--fix", quoted(`${name}=${pose.join(",")}`));
  words.push("--out", spec.value?.time ? "motions.jsonl" : "scenes.json");
  return words.join(" ");
}

/** What to do first so that the command finds the spec as it is on the page. */
export function before(): string {
  if (alone || !spec.value) return "";
  return unsaved.value ? `save the spec first${saved.value.path ? "" : " (as my.spec)"}: the command reads it from the disk` : "";
}
