// All scenes as small pictures.
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Thumbs, type Wanted } from "../scene/thumbs";
import { calm } from "../motions";
import { coming, label, layout, lit, meshes, movedScenes, moves, outdated, preparing, preview, result, selected, shown, spec, view, wrong } from "../state";
import { select, step } from "../store";
import { theme } from "../theme";
import type { JSX } from "preact";
import type { Pose, Result } from "../types";
import { signed } from "../words";

const LASTS = 4000; // ms that a motion takes in a small picture, at most
const REST = 6; // steps that its end is shown

const thumbs = new Thumbs();
const drawn = new WeakMap<HTMLButtonElement, Pose[]>(); // what each picture shows

export function Grid() {
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => {
    let soon = 0;
    return effect(() => {
      // whatever the pictures depend on
      const now = spec.value, found = result.value, packed = meshes.value, flat = view.value === "top" && !!theme.value, all = shown.value, big = layout.value;
      void moves.value;
      cancelAnimationFrame(soon);
      soon = requestAnimationFrame(() => {
        if (!now || !found || !root.current) return;
        thumbs.flat = flat;
        thumbs.setSpec(now, packed);
        const wanted: Wanted[] = [];
        const high = big === "many" ? 2 : 1;
        for (const button of root.current.querySelectorAll<HTMLButtonElement>("button[data-scene]")) {
          const k = Number(button.dataset.scene);
          const canvas = button.querySelector("canvas")!;
          const width = Math.round(canvas.clientWidth * Math.min(devicePixelRatio || 1, 2)) || 128 * high;
          if (canvas.width !== width) {
            canvas.width = width;
            canvas.height = Math.round((width * 3) / 4);
          }
          const { poses, bases } = sceneOf(found, k);
          if (!poses || !all.includes(k)) continue;
          if (drawn.get(button) !== poses) button.classList.remove("drawn"); // not the picture of another scene
          wanted.push({ canvas, poses, bases, done: () => (button.classList.add("drawn"), drawn.set(button, poses)) });
        }
        const first = wanted.findIndex((one) => one.canvas.parentElement?.getAttribute("aria-selected") === "true");
        if (first > 0) wanted.unshift(...wanted.splice(first, 1));
        thumbs.draw(wanted);
      });
    });
  }, []);
  useEffect(() =>
    effect(() => {
      const some = coming.value;
      const canvas = root.current?.querySelector("canvas");
      if (some.length && canvas) thumbs.prepare(some, canvas.width, canvas.height, () => (preparing.value = false));
      else preparing.value = false;
    }), []);
  useEffect(() =>
    effect(() => {
      // a ring round the object that is lit, in every picture
      const index = spec.value?.objects.findIndex((one) => one.name === lit.value) ?? -1;
      const found = result.value;
      for (const spot of root.current?.querySelectorAll<HTMLElement>("button[data-scene] > i") ?? []) {
        const scene = index < 0 || !found ? null : sceneOf(found, Number(spot.parentElement!.dataset.scene));
        const place = scene && thumbs.place(index, scene);
        spot.hidden = !place;
        if (place) Object.assign(spot.style, { left: `${100 * (place.x - place.r)}%`, top: `calc((100% - 17px) * ${place.y})`, width: `${200 * place.r}%` });
      }
    }), []);
  const now = spec.value, found = result.value;
  const all = shown.value;
  void moves.value;
  const point = (k: number) => (event: MouseEvent) => {
    const box = (event.currentTarget as HTMLElement).querySelector("canvas")!.getBoundingClientRect();
    const at: [number, number] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    const scene = found && sceneOf(found, k);
    lit.value = scene && !found.motions ? thumbs.under(at, scene) : null; // a motion plays under the pointer
  };
  const playing = useRef(0);
  /** Play a motion in its small picture, as long as the pointer is over it. */
  const playSmall = (k: number) => (event: Event) => {
    const motion = found?.motions?.[k];
    const canvas = (event.currentTarget as HTMLElement).querySelector("canvas")!;
    stopSmall();
    if (!motion || calm.matches) return;
    const began = performance.now(), last = motion.length - 1;
    const next = () => {
      const t = Math.floor((performance.now() - began) / Math.min(120, LASTS / last)) % (last + REST);
      thumbs.play(canvas, motion[Math.min(t, last)], found.rises?.[k][Math.min(t, last)] ?? []);
      playing.current = window.setTimeout(next, 60);
    };
    next();
  };
  const stopSmall = () => clearTimeout(playing.current);
  const lastAgain = (k: number) => (event: Event) => {
    stopSmall();
    const canvas = (event.currentTarget as HTMLElement).querySelector("canvas")!;
    if (found?.motions) thumbs.play(canvas, found.poses[k], found.bases[k]);
  };
  useEffect(() => stopSmall, []);
  const what = now?.time ? "motion" : "scene";
  const keys = (event: KeyboardEvent) => {
    const by = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns(root.current!), ArrowDown: columns(root.current!) }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    step(by);
    requestAnimationFrame(() => root.current?.querySelector<HTMLElement>("[aria-selected=true]")?.focus());
  };
  useEffect(() => {
    root.current?.querySelector<HTMLElement>("[aria-selected=true]")?.scrollIntoView({ block: "nearest", inline: "nearest" });
  });
  return (
    <div ref={root} class={`grid ${layout.value}${(found?.together ?? 1) > 1 ? " paired" : ""}${preview.value ? " early" : wrong.value || outdated.value ? " behind" : ""}`} role="listbox" aria-label={`${what}s`} tabIndex={-1} onKeyDown={keys}>
      {now && found
        ? inGroups(all, found.together ?? 1, (k) => {
            const hand = movedScenes.get(found.poses[k])?.report;
            const each = hand ? Object.fromEntries(Object.entries(hand.phi).map(([name, values]) => [name, values[0]])) : Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, values[k]]));
            const part = partOf(found, k);
            const phi = label.value === "require" ? (hand ? hand.require?.[0] : found.require?.[k]) : each[label.value];
            return (
              <button key={k} role="option" data-scene={k} aria-selected={k === selected.value} tabIndex={k === selected.value ? 0 : -1} onClick={() => select(k)} onDblClick={() => (layout.value = "one")} onMouseEnter={found.motions ? playSmall(k) : undefined} onMouseMove={point(k)} onMouseLeave={(event) => { lit.value = null; if (found.motions) lastAgain(k)(event); }} aria-label={`${part || `${what} ${k + 1}`}, ${label.value} ${phi === undefined ? "" : signed(phi)}`}>
                <canvas width={128} height={96} />
                <i hidden />
                <span class={phi === undefined ? "" : phi >= 0 ? "good" : "bad"} data-phi={JSON.stringify(each)}>{part ? <em>{part} </em> : null}{phi !== undefined ? signed(phi) : hand ? "?" : ""}{hand ? " ✎" : ""}</span>
              </button>
            );
          })
        : null}
      {!all.length && found ? <p class="empty">{preview.value ? `None of the ${what}s so far lies in these ranges; more are being sampled.` : `No ${what} lies in these ranges.`}</p> : null}
    </div>
  );
}

/** A scene as it stands, moved by hand or not. */
function sceneOf(found: Result, k: number): { poses: Pose[]; bases: number[] } {
  const hand = movedScenes.get(found.poses[k]);
  return { poses: hand?.poses ?? found.poses[k], bases: hand && !found.motions ? hand.report.bases[0] : found.bases[k] };
}

/** What a scene is of those that belong together: the start or the goal of a pair. "" for one that stands alone. */
export function partOf(found: Result, k: number): string {
  const size = found.together ?? 1, at = k % size;
  if (size < 2) return "";
  return `${Math.floor(k / size) + 1} ${at === 0 ? "start" : at === size - 1 ? "goal" : `step ${at}`}`;
}

/** The pictures, those that belong together side by side in one frame. */
function inGroups(all: number[], size: number, one: (k: number) => JSX.Element): JSX.Element[] {
  if (size < 2) return all.map(one);
  const groups = new Map<number, number[]>();
  for (const k of all) groups.set(Math.floor(k / size), [...(groups.get(Math.floor(k / size)) ?? []), k]);
  return [...groups].map(([number, some]) => <div key={`group ${number}`} role="group" class="pair" aria-label={`${size === 2 ? "pair" : "motion"} ${number + 1}`}>{some.map(one)}</div>);
}

/** How many pictures a row has. */
function columns(root: HTMLElement): number {
  const all = [...root.querySelectorAll<HTMLElement>("button[data-scene]")];
  const top = (one: HTMLElement) => one.getBoundingClientRect().top;
  const next = all.findIndex((one) => top(one) > top(all[0]) + 2);
  return Math.max(1, next < 0 ? all.length : next);
}

