// The command line that makes the same scenes.
import { alone, boot, request, saved, spec, unsaved } from "./state";
import { fileName } from "./files";
import type { Ends, Pose } from "./types";

function quoted(word: string): string {
  return /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replace(/'/g, `'\\''`)}'`;
}

/** What the command reads: the file, or an example as it is shipped. */
function source(): { name: string; there: boolean } {
  const { path, name, shipped } = saved.value;
  if (path === null && shipped && !unsaved.value) return { name: shipped, there: true };
  return { name: inFolder(path ?? fileName(name)), there: path !== null && !unsaved.value };
}

/** A path in the opened folder, as seen from where the server was started. */
function inFolder(path: string): string {
  return boot.where === "." ? path.replace(/^-/, "./-") : `${boot.where}/${path}`;
}

function range([low, high]: Ends): string {
  return `${low ?? ""}:${high ?? ""}`;
}

export function command(): string {
  if (alone) return alone.command;
  const { phi, n, seed, method, spread, fix } = request.value;
  const file = method === "model" && boot.model ? inFolder(boot.model) : source().name;
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
  const { name, there } = source();
  if (there || (request.value.method === "model" && boot.model && !unsaved.value)) return "";
  return `save the spec first${saved.value.path ? "" : ` (as ${name})`}: the command reads it from the disk`;
}
