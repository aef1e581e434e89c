// How rare each phi is, and ranges that are worth asking for.
import { ask } from "./server";
import { about, alone, label, measuring, rarity, spec } from "./state";
import { setEnds } from "./store";
import type { Ends, Rarity } from "./types";
import { round } from "./words";

export const kept = new Map<string, Record<string, Rarity>>();

let under = ""; // what is being measured

/** Whether the spec as it stands is being measured, for a long time as motions are: worth going on with. */
export function measuringMotions(): boolean {
  return !!spec.value?.time && under === spec.value.sha256;
}

export async function measure(): Promise<void> {
  const now = spec.value;
  if (!now || alone || measuringMotions() || now.labels.every((one) => one.name in rarity.value)) return;
  measuring.value = true;
  under = now.sha256;
  try {
    await ask("range", about(), (part: Rarity) => {
      const known = { ...(kept.get(now.sha256) ?? {}), [part.label]: bridged(part) };
      kept.set(now.sha256, known);
      if (spec.value?.sha256 === now.sha256) rarity.value = known;
    });
  } catch {
    /* the handles lie over the bounds instead */
  } finally {
    if (under === now.sha256) {
      under = "";
      measuring.value = false;
    }
  }
}

export function remember(found: Rarity[]): void {
  rarity.value = Object.fromEntries(found.map((one) => [one.label, bridged(one)]));
}

/** A curve without gaps between what is known: the probability of this phi or more falls with phi, that of this phi or
 * less rises, so that it is known between two known ones to lie between theirs. At the ends it stays unknown. */
function bridged(one: Rarity): Rarity {
  const curve = one.curve.map((point) => [...point] as Rarity["curve"][number]);
  for (const which of [1, 2] as const) {
    let before = -1;
    curve.forEach((point, at) => {
      if (point[which] === null) return;
      for (let k = before + 1; before >= 0 && k < at; k++) {
        const share = (curve[k][0] - curve[before][0]) / (point[0] - curve[before][0] || 1);
        curve[k][which] = curve[before][which]! + share * (point[which]! - curve[before][which]!);
      }
      before = at;
    });
  }
  return { ...one, curve };
}

/** log10 of the probability of a range, None where nobody knows. */
export function probability(one: Rarity, [low, high]: Ends): number | null {
  const at = (phi: number, which: 1 | 2): number | null => {
    const { curve } = one;
    if (!curve.length) return null;
    if (phi <= curve[0][0]) return which === 1 ? 0 : curve[0][2];
    if (phi >= curve[curve.length - 1][0]) return which === 2 ? 0 : curve[curve.length - 1][1];
    const next = curve.findIndex((point) => point[0] >= phi);
    const [a, b] = [curve[next - 1], curve[next]];
    if (a[which] === null || b[which] === null) return null;
    const share = b[0] > a[0] ? (phi - a[0]) / (b[0] - a[0]) : 0;
    return a[which]! + share * (b[which]! - a[which]!);
  };
  const share = (value: number | null) => (value === null ? 0 : 10 ** value);
  if (low === null && high === null) return 0;
  if (high === null) return at(low!, 1);
  if (low === null) return at(high, 2);
  const up = share(at(low, 1)) - share(at(high, 1));
  const down = share(at(high, 2)) - share(at(low, 2));
  const found = share(at(low, 1)) <= share(at(high, 2)) ? up : down;
  return found > 0 ? Math.log10(found) : null;
}

export function band(name: string, of = label.value): void {
  const one = rarity.value[of]?.bands.find((two) => two.name === name);
  if (one) setEnds(of, [one.low, one.high]);
}

export function justSolved(of = label.value): void {
  const top = rarity.value[of]?.reached[1] ?? spec.value?.labels.find((one) => one.name === of)?.bounds[1] ?? 0.1;
  setEnds(of, [0, round(Math.max(top, 1e-3) * 0.1)]);
}
