// What changes the page: its text, its scenes, and what is asked of the server.
import { batch } from "@preact/signals";
import { foresee, leaveLook, look, others, type Look } from "./early";
import { inside, learn, spread } from "./known";
import { choose, frame, path, playing, rises, seek, taken } from "./motions";
import { kept, measure, measuringMotions } from "./rare";
import { ask, askOne, Ended, onReconnect, Refused, stop } from "./server";
import { about, alone, bases, boot, busy, changed, clash, edited, explaining, finding, judged, label, meshes, message, methodsFor, motion, movedScenes, moves, on, outdated, poses, preview, problems, rarity, refusal, replaying, report, request, rested, result, selected, shown, spec, text, thing, wrong } from "./state";
import type { Ends, Pose, Report, Request, Result, Spec } from "./types";

// ---- the text

let checks = 0;
let sampled = false; // whether anything was sampled: until then, the scenes that were opened are shown

/** The scenes of the opened file for these numbers of things; null where it has none, or the text is another one. */
function stored(found: Spec): Result | null {
  if (sampled || text.value !== boot.text) return null;
  const fits = (counts: Record<string, number>) => (found.numbers ?? []).every(({ name, now }) => counts[name] === now);
  if (fits(boot.request.counts ?? {})) return boot.scenes;
  return boot.parts.find(({ counts }) => fits(counts))?.scenes ?? null;
}

const PAUSE = 40; // ms without a further change after which a text is checked
const RESTS = 600; // ms without a further change after which mistakes are told: until then somebody types a line
const PATIENCE = 1000; // ms that the server may take to answer
const SILENT = "the server does not answer yet";
let typed: ReturnType<typeof setTimeout> | undefined;
let lastKey = -RESTS;

export function setText(value: string): void {
  if (value === text.value && spec.value) return; // of a file that was opened again nothing is known
  text.value = value;
  lastKey = performance.now();
  (window as any).scenegen.typed = performance.now();
  clearTimeout(typed);
  typed = setTimeout(check, PAUSE);
}

let owed = false; // scenes were under way when they were ended

/** End what works for the text before. */
function quiet(): void {
  owed ||= busy.value === "sample";
  samples++;
  clearTimeout(waitingForSample);
  for (const job of ["sample", "range", "spread"]) void stop(job);
}

export async function check(): Promise<void> {
  if (alone) return;
  const mine = ++checks, of = text.value;
  quiet();
  const early = sampled || !boot.scenes ? foresee() : null;
  busy.value = "check";
  const later = (then: () => void) => void setTimeout(() => mine === checks && then(), Math.max(0, lastKey + RESTS - performance.now()));
  const was = outdated.value;
  const late = setTimeout(() => {
    if (mine !== checks) return;
    outdated.value = true;
    message.value = SILENT;
  }, PATIENCE);
  try {
    await ask("check", { ...about(), have: Object.keys(meshes.value) }, (part) => {
      clearTimeout(late);
      if (mine !== checks) return;
      if ("spec" in part) {
        if (message.value === SILENT) {
          message.value = "";
          outdated.value = was;
        }
        if (part.spec) wrong.value = false;
        else later(() => (wrong.value = true));
        if (message.value === refusal.value?.title) message.value = "";
        refusal.value = null; // what was said of the text before
        if (part.spec) take(part.spec, early);
        else {
          leaveLook();
          busy.value = "";
        }
      } else if ("meshes" in part) meshes.value = { ...meshes.value, ...part.meshes };
      else {
        const tell = () => {
          batch(() => {
            problems.value = part.problems ?? [];
            judged.value = of;
          });
          if (clash.value?.proved && busy.value === "sample") refuseClash();
          else if (clash.value && refusal.value) refuse(new Refused(clash.value.refusal)); // it was refused before this was known
        };
        if (part.problems?.length) later(tell);
        else tell();
      }
    });
  } catch (error) {
    if (mine === checks && !(error instanceof Ended)) refuse(error);
  } finally {
    clearTimeout(late);
    if (mine === checks && busy.value === "check") busy.value = "";
  }
}

/** Another file is opened: nothing that was asked of the one before, or shown of it, is of this one. */
export function forget(): void {
  quiet();
  owed = false;
  batch(() => {
    request.value = { ...request.value, phi: {}, fix: {}, counts: undefined };
    spec.value = null;
    problems.value = [];
    wrong.value = false;
    refusal.value = null;
    thing.value = null;
    clear();
  });
}

function clear(): void {
  movedScenes.clear();
  result.value = null;
  poses.value = [];
  on.value = null;
  report.value = null;
  motion.value = null;
  path.value = [];
  playing.value = false;
  edited.value = false;
  selected.value = 0;
}

/** Ask for another number of things, where the spec draws it. */
export function setCount(name: string, count: number): void {
  request.value = { ...request.value, counts: { ...request.value.counts, [name]: count } };
  void check();
}

/** Take a spec over from the server; `early` is a first look at it. */
function take(found: Spec, early: Look | null): void {
  const before = spec.value;
  const same = before?.sha256 === found.sha256;
  batch(() => {
    spec.value = found;
    if (!found.labels.some((one) => one.name === label.value)) label.value = found.labels[0].name;
    if (same) return;
    const now = request.value;
    const known = new Set(before ? before.labels.map((one) => one.name) : Object.keys(now.phi));
    const phi: Record<string, Ends> = {};
    const free = others();
    for (const one of found.labels) phi[one.name] = one.name in now.phi ? now.phi[one.name] : known.has(one.name) && before ? [null, null] : [...free];
    const loose = new Set(found.objects.filter((one) => !one.fixed).map((one) => one.name));
    const fix = Object.fromEntries(Object.entries(now.fix).filter(([name]) => loose.has(name)));
    const n = Math.max(1, Math.min(now.n, found.most));
    const method = found.time && !methodsFor(found).includes(now.method) ? "auto" : now.method;
    request.value = { ...now, phi, fix, n, method };
    if (thing.value && !found.objects.some((one) => one.name === thing.value)) thing.value = null;
    rarity.value = kept.get(found.sha256) ?? {};
    outdated.value = true; // what stays in sight until the new scenes are there
    changed.value = "text";
    if (before && !sameObjects(before, found)) clear();
  });
  const old = same && result.value ? null : stored(found);
  if (old) {
    const first = taken(old);
    learn(first);
    show(first, false);
    rest();
  } else if (!same || !result.value || owed) void sample(early);
  else {
    leaveLook();
    explain();
    rest();
  }
}

/** Once nobody waits for anything: how rare each phi is, and scenes that a handle may show. */
function rest(): void {
  const mine = samples;
  setTimeout(() => mine === samples && void measure().then(() => mine === samples && void spread()), 350);
}

export function sameObjects(one: Spec | null, other: Spec | null): boolean {
  const facts = (spec: Spec) => JSON.stringify(spec.objects.map(({ name, surfaces }) => [name, surfaces.length > 1 ? surfaces : []]));
  const lasts = (spec: Spec) => `${spec.time?.steps}`;
  return !!one && !!other && facts(one) === facts(other) && lasts(one) === lasts(other);
}

// ---- scenes

let samples = 0;
const FEW = 4; // objects: the scenes of fewer are mostly there at once
const QUICK = 150; // ms that these get before a first look is shown
const HEAD = 400; // ms that the first look at more gets before the scenes themselves take a processor from it
const pause = (ms: number) => new Promise<void>((then) => setTimeout(then, ms));
const ENOUGH = 4; // known scenes that are as good as a first look

export async function sample(early: Look | null = null): Promise<void> {
  if (alone) {
    if (!shown.value.includes(selected.value)) select(shown.value[0] ?? 0);
    return;
  }
  const now = spec.value;
  if (!now) return;
  const mine = ++samples;
  sampled = true;
  owed = false;
  if (clash.value?.proved) return refuseClash();
  busy.value = "sample";
  finding.value = null;
  rested.value = false;
  if (!measuringMotions()) void stop("range"); // what somebody waits for goes first
  void stop("spread");
  const fields = { ...about(), request: request.value, watch: !!now.time };
  const first = inside(request.value).poses.length < Math.min(ENOUGH, request.value.n) ? look(early) : null;
  if (!first) leaveLook();
  else {
    const few = now.objects.length < FEW;
    const seen = (few ? pause(QUICK) : Promise.resolve()).then(() => first.found).then((found) => {
      if (!found || mine !== samples || busy.value !== "sample") return;
      learn(found);
      narrow();
    });
    if (!few) await Promise.race([seen, pause(HEAD)]);
    if (mine !== samples) return;
  }
  try {
    let last: Result | null = null;
    await ask("sample", fields, (part: Result | { look: Result; hits: number; left: number }) => {
      if (mine !== samples || !("look" in part)) return void (last = part as Result);
      finding.value = { hits: part.hits, left: part.left };
      show(taken(part.look), true);
    });
    if (mine !== samples) return;
    const found = taken(last!);
    leaveLook();
    learn(found);
    show(found, false);
    rest();
  } catch (error) {
    if (mine !== samples || error instanceof Ended) return;
    outdated.value ||= !preview.value || !!finding.value;
    preview.value = false;
    refuse(clash.value ? new Refused(clash.value.refusal) : error); // one cause is told once, in the same words
  } finally {
    if (mine === samples) busy.value = "";
  }
}

/** Look no further for what is proved not to be there. */
function refuseClash(): void {
  giveUp();
  refuse(new Refused(clash.value!.refusal));
}

/** End the search for motions, and keep those that were found in the range. */
export function keepFound(): void {
  const found = result.value!, count = finding.value!.hits;
  const first = <T>(all: T[] | null | undefined) => all && all.slice(0, count);
  const phi = Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, values.slice(0, count)]));
  const title = `${count === 1 ? "this is the only motion" : `these are the ${count} motions`} found when you stopped: the first ones, not a fair sample`;
  giveUp();
  finding.value = null;
  show({ ...found, poses: first(found.poses)!, motions: first(found.motions)!, rises: first(found.rises), bases: first(found.bases)!, require: first(found.require) ?? null, phi, warnings: [{ code: "", title }] }, false);
  rest();
}

/** End the sampling under way; what was found stays. */
export function giveUp(): void {
  samples++;
  clearTimeout(waitingForSample);
  void stop("sample");
  leaveLook();
  batch(() => {
    outdated.value ||= !preview.value || !!finding.value;
    preview.value = false;
    busy.value = "";
  });
}

/** Show those scenes that are known to lie in the ranges, until the wanted ones are there. */
function narrow(): void {
  show(inside(request.value), true);
  (window as any).scenegen.narrowed = performance.now();
}

export function show(found: Result, early: boolean): void {
  batch(() => {
    refusal.value = null;
    outdated.value = false;
    changed.value = "request";
    result.value = found;
    preview.value = early;
    const at = early ? found.poses.indexOf(poses.value) : -1; // a scene that stays in range stays in sight
    select(at < 0 ? Math.min(selected.value, found.poses.length - 1) : at, true);
    if (!early) {
      const some = found.warnings.map((one) => `; ${one.title}`).join("");
      message.value = `${found.poses.length} ${found.motions ? "motions" : "scenes"}${some}`;
    }
  });
}

function refuse(error: unknown): void {
  const told = error instanceof Refused ? error.refusal : null;
  const title = error instanceof Error ? error.message : String(error);
  refusal.value = told ?? { title, label: "", note: "", help: "", text: title };
  message.value = title;
}

export function select(index: number, again = false): void {
  const found = result.value;
  if (!found || !found.poses.length) return;
  index = Math.max(0, Math.min(index, found.poses.length - 1));
  if (!again && index === selected.value) return;
  if (again && !found.motions && found.poses[index] === poses.value && !edited.value && report.value?.decides) {
    selected.value = index; // it is on the screen, and explained
    return;
  }
  batch(() => {
    selected.value = index;
    if (found.motions) choose(found, index);
    else {
      poses.value = found.poses[index];
      bases.value = found.bases[index];
    }
    on.value = found.on?.[index] ?? null;
    edited.value = false;
    replaying.value = false;
    const hand = movedScenes.get(found.poses[index]);
    if (hand) {
      stand(hand);
      report.value = hand.report;
      return;
    }
    const phi = Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, [values[index]]]));
    report.value = { phi, require: found.require ? [found.require[index]] : null, bases: [found.bases[index]] };
  });
  explain();
}

/** Have the large scene stand as it was moved to. */
function stand(hand: { poses: Pose[]; on: number[] | null; path: Pose[][] }): void {
  edited.value = true;
  on.value = hand.on;
  if (spec.value?.time) {
    path.value = hand.path;
    seek(frame.value);
  } else poses.value = hand.poses;
}

let telling: ReturnType<typeof setTimeout> | undefined;

/** Keep the scene that is moved by hand: it stands so until it is put back, whatever else is looked at. */
function keepMoved(): void {
  const of = result.value?.poses[selected.value];
  if (!of || !edited.value || playing.value || !report.value) return;
  movedScenes.set(of, { poses: spec.value?.time ? path.value[path.value.length - 1] : poses.value, on: on.value, path: path.value, report: report.value });
  clearTimeout(telling);
  telling = setTimeout(() => moves.value++, 120); // its small picture follows the hand a little later
}

interface Stood {
  of: Pose[];
  moved: boolean;
  poses: Pose[];
  on: number[] | null;
  path: Pose[][];
  fix: Request["fix"];
}
const past: Stood[] = [];
let future: Stood[] = []; // what was taken back
const MOST_PAST = 200;

function stands(): Stood | null {
  const of = result.value?.poses[selected.value];
  return of ? { of, moved: edited.value, poses: poses.value, on: on.value, path: path.value, fix: request.value.fix } : null;
}

/** Remember how the large scene stands, before a hand changes it. */
export function remember(): void {
  const now = stands();
  if (now) past.push(now);
  if (past.length > MOST_PAST) past.shift();
  future = [];
}

/** Take back what hands did last. */
export function undo(): void {
  go(past, future, "nothing was moved before this");
}

/** Do again what was taken back. */
export function redo(): void {
  go(future, past, "nothing was taken back");
}

function go(from: Stood[], to: Stood[], none: string): void {
  let last = from.pop();
  while (last && !result.value?.poses.includes(last.of)) last = from.pop(); // of scenes that are gone
  if (!last) {
    message.value = none;
    return;
  }
  const { of, moved, fix } = last;
  batch(() => {
    const index = result.value!.poses.indexOf(of);
    if (index !== selected.value) select(index);
    to.push(stands()!);
    request.value = { ...request.value, fix };
    if (!moved) putBackNow();
    else stand(last);
  });
  if (moved) explain();
}

/** As it was sampled. */
export function putBack(): void {
  remember();
  putBackNow();
}

function putBackNow(): void {
  movedScenes.delete(result.value!.poses[selected.value]);
  moves.value++;
  select(selected.value, true);
}

/** The next or previous scene of those that are shown. */
export function step(by: number): void {
  const all = shown.value;
  if (!all.length) return;
  const at = all.indexOf(selected.value);
  select(all[(at + by + all.length) % all.length]);
}

export function change(fields: Partial<Request>): void {
  request.value = { ...request.value, ...fields };
  soon();
}

let waitingForSample: ReturnType<typeof setTimeout> | undefined;

const SOON = 50; // ms
const LATER = 150; // where there is something to look at

/** Sample soon: what changes many times a second is sampled a few times a second. */
export function soon(pause = SOON): void {
  if (!alone && spec.value) {
    samples++; // what is under way answers an older request
    busy.value = "sample";
  }
  clearTimeout(waitingForSample);
  waitingForSample = setTimeout(() => void sample(), alone ? 0 : pause);
}

export function setEnds(name: string, ends: Ends): void {
  change({ phi: { ...request.value.phi, [name]: ends } });
  if (alone || !result.value) return;
  narrow();
  if (result.value.poses.length >= ENOUGH) soon(LATER); // pictures first
}

// ---- what a scene is worth, and why

let askAgain = false;

/** Evaluate the scene as it stands. While an answer is under way, only the newest question waits. */
export function explain(): void {
  if (alone && edited.value) report.value = { phi: {}, require: null, bases: [bases.value] }; // nobody here knows
  else if (alone && report.value) report.value = { ...report.value, ...alone.reports[selected.value] };
  keepMoved();
  if (alone) return;
  if (explaining.value) {
    askAgain = true;
    return;
  }
  void explainNow();
}

async function explainNow(): Promise<void> {
  if (!poses.value.length || !spec.value) return;
  explaining.value = true;
  const mine = poses.value, mineText = text.value;
  try {
    const moving = spec.value.time ? path.value : null;
    const found = await askOne<Report>("evaluate", { ...about(), poses: [moving ?? mine], on: on.value && [on.value], why: true });
    batch(() => {
      if (poses.value.length !== mine.length || (moving && path.value.length !== moving.length)) return;
      report.value = found;
      if (poses.value === mine || moving) keepMoved();
      if (!moving) bases.value = found.bases[0];
      else {
        rises.value = (found.bases as unknown as number[][][] | null)?.[0] ?? null;
        if (!playing.value) seek(frame.value);
      }
    });
  } catch (error) {
    if (!(error instanceof Ended) && text.value === mineText && poses.value === mine) refuse(error);
  } finally {
    explaining.value = false;
    if (askAgain) {
      askAgain = false;
      explain();
    }
  }
}

export function next(): void {
  if (alone) step(1);
  else change({ seed: request.value.seed + 1 });
}

onReconnect(() => void check());
