// Motions of a spec over time: the one that is shown, its moments, and how it is played.
import { batch, computed, signal } from "@preact/signals";
import { bases, decides, edited, poses, spec } from "./state";
import type { Decides, Mark, Pose, Result } from "./types";

export const timed = computed(() => spec.value?.time ?? null);
export const path = signal<Pose[][]>([]); // the large motion: its poses, moment by moment
export const rises = signal<number[][] | null>(null); // and how high above the table objects stand in it
export const clock = signal(0); // the moment that is shown; between two of them while it plays
export const frame = computed(() => Math.round(clock.value));
export const playing = signal(false);
export const rate = signal<number | null>(null); // times real time; null: so that a motion takes a few seconds

const USUAL = 4; // seconds that a motion takes, about, unless somebody chooses
export const calm = matchMedia("(prefers-reduced-motion: reduce)");

/** A power of two, for a motion of some seconds. */
export function usual(): number {
  const now = timed.value;
  return now ? 2 ** Math.round(Math.log2(Math.max(now.steps * now.dt, 1e-9) / USUAL)) : 1;
}

export function seconds(moment: number): string {
  const dt = timed.value?.dt ?? 1;
  const digits = dt >= 1 && Number.isInteger(dt) ? 0 : Math.min(3, Math.max(1, Math.ceil(-Math.log10(dt))));
  return `${(moment * dt).toFixed(digits)} s`;
}

/** Motions as the server sends them become scenes, too: each is its last moment where one picture has to do. */
export function taken(found: Result): Result {
  if (!found.motions || found.poses) return found;
  const lifts = found.bases as unknown as number[][][] | null;
  const last = found.motions[0]?.length - 1;
  return {
    ...found,
    poses: found.motions.map((one) => one[last]),
    rises: lifts,
    bases: found.motions.map((one, k) => lifts?.[k][last] ?? one[last].map(() => 0)),
  };
}

/** The moments of a motion as scenes; of a scene itself. */
export function moments(found: Result, k: number): Pose[][] {
  return found.motions ? found.motions[k] : [found.poses[k]];
}

/** Take a motion of the set as the large one, at the moment that is shown. */
export function choose(found: Result, k: number): void {
  path.value = found.motions![k];
  rises.value = found.rises?.[k] ?? null;
  seek(Math.min(frame.peek(), path.value.length - 1));
}

/** Show a moment; between two moments, poses on the way from one to the other. */
export function seek(moment: number): void {
  const all = path.peek();
  if (!all.length) return;
  const t = Math.min(Math.max(moment, 0), all.length - 1);
  const low = Math.floor(t), share = t - low;
  batch(() => {
    clock.value = t;
    poses.value = share ? all[low].map((one, k) => between(one, all[low + 1][k], share)) : all[low];
    const at = Math.round(t);
    bases.value = rises.peek()?.[at] ?? all[at].map(() => 0);
  });
}

function between(a: Pose, b: Pose, share: number): Pose {
  const turn = Math.atan2(Math.sin(b[2] - a[2]), Math.cos(b[2] - a[2]));
  return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * turn];
}

/** Stop at a whole moment. */
export function rest(): void {
  playing.value = false;
  if (clock.peek() !== frame.peek()) seek(frame.peek());
}

export function stepBy(by: number): void {
  playing.value = false;
  seek(frame.peek() + by);
}

export function toEnd(which: "first" | "last"): void {
  playing.value = false;
  seek(which === "first" ? 0 : path.peek().length - 1);
}

export function playMotion(): void {
  const all = path.peek(), now = timed.peek();
  if (playing.peek() || !now || all.length < 2) return rest();
  if (clock.peek() >= all.length - 1) seek(0);
  playing.value = true;
  let before = performance.now(), at = clock.peek();
  const next = () => {
    if (!playing.peek()) return;
    if (timed.peek() !== now || path.peek().length !== all.length) return rest();
    const time = performance.now();
    at = Math.min(at + (((time - before) / 1000) * (rate.peek() ?? usual())) / now.dt, all.length - 1);
    before = time;
    seek(calm.matches ? Math.floor(at) : at);
    if (at >= all.length - 1) playing.value = false;
    else requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}

/** Change the pose of an object at the moment that is shown, or (`always`) at all moments. */
export function change(index: number, pose: Pose, always: boolean): void {
  rest();
  const at = frame.peek();
  path.value = path.peek().map((one, t) => (t === at || always ? one.map((old, k) => (k === index ? pose : old)) : one));
  poses.value = path.value[at];
  edited.value = true;
}

/** What the spec's formula measures is drawn at the moment that decides. */
export const marks = computed<Mark[]>(() => {
  const one: Decides | null = decides.value;
  if (!one) return [];
  return timed.value && clock.value !== one.moment ? [] : one.marks;
});

/** Where objects go in the large motion: for each that moves its way, [x, y] moment by moment. */
export const trails = computed<{ index: number; points: [number, number][] }[]>(() => {
  const all = path.value;
  if (!timed.value || all.length < 2) return [];
  return all[0]
    .map((_, index) => ({ index, points: all.map((one) => [one[index][0], one[index][1]] as [number, number]) }))
    .filter(({ points }) => points.some(([x, y]) => Math.hypot(x - points[0][0], y - points[0][1]) > 1e-4));
});
