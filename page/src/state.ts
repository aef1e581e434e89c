// What the page shows, as signals.
import { computed, effect, signal } from "@preact/signals";
import type { Boot, Decides, Draft, PackedMesh, Pose, Problem, Rarity, Refusal, Report, Request, Result, Spec } from "./types";

export const boot: Boot = JSON.parse(document.getElementById("data")!.textContent!);
export const alone = boot.alone ?? null;

/** The sampling methods that draw scenes, or motions, of a spec. */
export const methodsFor = (of: Spec) => boot.methods.filter((one) => (one.motions || !of.time) && (!one.model || !!boot.model)).map((one) => one.name);

export const text = signal(boot.text);

/** What is open: a file, with the hash and the text that it was read or saved with; or, without a `path`, a text that no
 * file has. `shipped` is the name of the example that `text` is. */
export interface Saved {
  path: string | null;
  sha: string | null;
  text: string | null;
  name: string;
  shipped?: string | null;
}
export const saved = signal<Saved>({
  path: boot.path,
  sha: boot.sha,
  text: boot.path && !boot.sha ? null : boot.text, // the file may be gone
  name: boot.name,
  shipped: boot.shipped,
});
export const conflict = signal<{ path: string; text: string; sha: string } | null>(null); // what another program wrote
export const restored = signal(false); // what is in the editor was written earlier, and not saved
export const offered = signal<Draft | null>(null); // what was written earlier in this example, and not saved
export const spec = signal<Spec | null>(null);
export const wrong = signal(false); // the text has a mistake: what is shown is of the last text that had none
export const problems = signal<Problem[]>([]);
export const judged = signal(""); // the text that has these problems
export const request = signal<Request>({ phi: {}, n: 16, seed: 0, method: boot.model ? "model" : "auto", spread: "flat", fix: {} });
export const result = signal<Result | null>(null);
export const preview = signal(false); // the scenes are a first look, the wanted ones are under way
export const outdated = signal(false); // the scenes are of an older text or request
export const changed = signal<"text" | "request">("request"); // which of them it was
export const finding = signal<{ hits: number; left: number } | null>(null); // motions that are found one by one
export const refusal = signal<Refusal | null>(null);
export const busy = signal<"" | "check" | "sample">("");
export const message = signal(""); // said to everybody, screen readers included
export const selected = signal(0);
export const poses = signal<Pose[]>([]);
export const bases = signal<number[]>([]);
export const on = signal<number[] | null>(null); // on which of their surfaces objects stand, as Report has it
export const edited = signal(false);
/** Scenes that were moved by hand, by the poses that they were sampled with: as they stand, and what they are worth. */
export interface Moved {
  poses: Pose[];
  on: number[] | null;
  path: Pose[][]; // of a motion
  report: Report;
}
export const movedScenes = new Map<Pose[], Moved>();
export const moves = signal(0); // changes with them
export const report = signal<Report | null>(null);
export const label = signal(""); // the label that the page explains
export const thing = signal<string | null>(null); // the selected object
export const lit = signal<string | null>(null); // the object that is pointed at, wherever on the page
export const pointed = signal<number | null>(null); // the line of the tree under the pointer
export const rarity = signal<Record<string, Rarity>>({});
export const measuring = signal(false);
export const rested = signal(false); // nothing more is asked for until somebody does something
export const coming = signal<{ poses: Pose[]; bases: number[] }[]>([]); // scenes that a handle may show next
export const preparing = signal(false); // their pictures are being drawn
export const explaining = signal(false); // phi of the scene as it stands is under way
export const meshes = signal<Record<string, PackedMesh>>({});
export const view = signal<"3d" | "top">("3d");
export const layout = signal<"one" | "many">("one");
export const tab = signal<"request" | "why" | "where" | "motion">("request");
export const pane = signal<"spec" | "scenes" | "panel">("scenes"); // on narrow screens
export const names = signal(false);
export const heat = signal(false);
export const help = signal(false);
export const replaying = signal(false);

export interface Motion {
  name: string;
  times: number[]; // seconds
  path: Pose[];
  phi: Record<string, number[]> | null;
}
export const motion = signal<Motion | null>(null);
export const moment = signal(0); // of the motion, in seconds

export const scenes = computed(() => result.value?.poses.length ?? 0);
export const stale = computed(() => scenes.value === 0 && (preview.value || busy.value === "sample")); // the large picture is of an older request
export const movable = computed(() => !alone || !spec.value?.time); // motions are not moved without a server: nothing would score them
export const unsaved = computed(() => saved.value.text !== text.value);

/** The scenes that are shown: all, or in a page without a server those in the ranges. */
export const shown = computed(() => {
  const found = result.value;
  if (!found) return [] as number[];
  const all = found.poses.map((_, index) => index);
  if (!alone) return all;
  const wanted = Object.entries(request.value.phi);
  return all.filter((index) =>
    wanted.every(([name, [low, high]]) => {
      const phi = found.phi[name]?.[index];
      return phi !== undefined && (low === null || phi >= low) && (high === null || phi <= high);
    }),
  );
});
const CLASHES: Record<string, boolean> = { "cannot-be-satisfied": true, "requirement-cannot-be-met": true, "hardly-satisfied": false, "requirement-hardly-met": false }; // whether it is proved

/** Parts of the text that clash so that scenes as they are wanted cannot be, or can hardly be: told once, as the list of
 * problems has it. */
export const clash = computed<{ refusal: Refusal; proved: boolean } | null>(() => {
  if (judged.value !== text.value) return null;
  for (const { message, code } of problems.value) {
    if (!code || !(code in CLASHES)) continue;
    const [title, ...rest] = message.split("\n");
    const low = request.value.phi[title.match(/^`([^`]+)`/)?.[1] ?? ""]?.[0] ?? null;
    if (title.includes("satisfied with ") || title.includes("met with ")) continue; // of some numbers of things
    if (title.startsWith("`") && (low === null || low < 0)) continue; // nobody asks for it to be satisfied
    const help = rest.find((line) => line.startsWith("help: ")) ?? "";
    const note = rest.filter((line) => line !== help).join("\n");
    return { refusal: { code, title, label: "", note, help: help.slice(6), text: message }, proved: CLASHES[code] };
  }
  return null;
});
export const decides = computed<Decides | null>(() => report.value?.decides?.[label.value] ?? null);

/** Which of the numbers in `on` is that of an object; -1 where it has one surface or none. */
export function chooser(now: Spec, name: string): number {
  return now.objects.filter((one) => one.surfaces.length > 1).findIndex((one) => one.name === name);
}

/** The text that a job is about. */
export function about(): { text: string; path: string | null; counts?: Record<string, number> } {
  return { text: text.value, path: saved.value.path, counts: request.value.counts };
}

// For tests: what is on the page, without reading it off the screen.
effect(() => {
  (window as any).scenegen = {
    ...(window as any).scenegen,
    poses: poses.value,
    on: on.value,
    bases: bases.value,
    report: report.value,
    result: result.value,
    request: request.value,
    spec: spec.value,
    busy: busy.value,
    preview: preview.value,
    wrong: wrong.value,
    refusal: refusal.value,
    problems: problems.value,
    rested: rested.value && !preparing.value,
    explaining: explaining.value,
    measuring: measuring.value,
    rarity: rarity.value,
    lit: lit.value,
  };
});
