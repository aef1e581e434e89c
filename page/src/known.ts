// Scenes that are known already: those of earlier requests, and some that are spread over all of phi. Where a range is
// moved, those that lie in it are shown at once, until the wanted ones are there.
import { askOne } from "./server";
import { about, alone, coming, preparing, rarity, rested, request, result, spec } from "./state";
import type { Ends, Pose, Request, Result } from "./types";

interface Known {
  poses: Result["poses"][number];
  bases: number[];
  on: number[] | null;
  phi: Record<string, number>;
  require: number | null;
  motion: Pose[][] | null;
  rises: number[][] | null;
}

const MOST = 1200;
const SPREAD = 24; // scenes over the phi of one label
const DRAWN = 160; // scenes whose pictures are drawn ahead

let about_ = ""; // what the scenes are of
let known: Known[] = [];
let spreads = new Set<string>();

function subject(): string {
  return `${spec.value?.sha256} ${JSON.stringify(request.value.fix)}`;
}

function fresh(): void {
  if (about_ === subject()) return;
  about_ = subject();
  known = [];
  spreads = new Set();
}

/** Keep verified scenes of the spec as it stands, with the objects that are held. */
export function learn(found: Result): void {
  fresh();
  const more = found.poses.map((poses, k) => ({
    poses,
    bases: found.bases[k],
    on: found.on?.[k] ?? null,
    phi: Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, values[k]])),
    require: found.require ? found.require[k] : null,
    motion: found.motions?.[k] ?? null,
    rises: found.rises?.[k] ?? null,
  }));
  const key = (one: Known) => JSON.stringify(one.motion ?? one.poses);
  const seen = new Set(more.map(key));
  known = [...more, ...known.filter((one) => !seen.has(key(one)))].slice(0, MOST);
}

export function within(phi: number | undefined, [low, high]: Ends): boolean {
  return phi !== undefined && (low === null || phi >= low) && (high === null || phi <= high);
}

/** The known scenes in the ranges of a request, at most as many as it wants: first those that are on the screen. */
export function inside(wanted: Request): Result {
  fresh();
  const ranges = Object.entries(wanted.phi);
  const fits = known.filter((one) => (one.require ?? 0) >= 0 && ranges.every(([name, ends]) => within(one.phi[name], ends)));
  const order = new Map((result.value?.poses ?? []).map((poses, k) => [poses, k]));
  const place = (one: Known) => order.get(one.poses) ?? order.size;
  const some = fits.sort((one, two) => place(one) - place(two)).slice(0, wanted.n);
  const labels = Object.keys(some[0]?.phi ?? {});
  return {
    poses: some.map((one) => one.poses),
    bases: some.map((one) => one.bases),
    ...(some.length && some[0].motion ? { motions: some.map((one) => one.motion!), rises: some[0].rises ? some.map((one) => one.rises!) : null } : {}),
    on: some.length && some[0].on ? some.map((one) => one.on!) : null,
    phi: Object.fromEntries(labels.map((name) => [name, some.map((one) => one.phi[name])])),
    require: some.length && some[0].require !== null ? some.map((one) => one.require!) : null,
    sampler: {},
    warnings: [],
    notes: [],
    took: 0,
  };
}

/** Ask for scenes over all of the phi that each label can have, while nothing else is to do. */
export async function spread(): Promise<void> {
  if (!(await spreadNow())) return;
  if (known.length) {
    preparing.value = true;
    coming.value = known.slice(0, DRAWN);
  }
  rested.value = true;
}

/** Whether it came to an end. */
async function spreadNow(): Promise<boolean> {
  const now = spec.value;
  if (!now || alone || !result.value || now.time) return true; // motions take longer than anybody waits
  fresh();
  for (const { label, reached } of Object.values(rarity.value)) {
    const mine = about_;
    if (spreads.has(label) || reached[0] >= reached[1]) continue;
    const wanted = { ...request.value, method: "auto", n: SPREAD, phi: { ...request.value.phi, [label]: reached } };
    try {
      const found = await askOne<Result | null>("spread", { ...about(), request: wanted });
      if (mine !== subject()) return false;
      spreads.add(label);
      if (found) learn(found);
    } catch {
      return false; // what somebody waits for took its place: it is asked for again after that
    }
  }
  return true;
}
