// All scenes as small pictures.
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Thumbs, type Wanted } from "../scene/thumbs";
import { calm } from "../motions";
import { coming, label, layout, meshes, movedScenes, moves, outdated, preparing, preview, result, selected, shown, spec, view, wrong } from "../state";
import { select, step } from "../store";
import { theme } from "../theme";
import type { Pose } from "../types";
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
          const hand = movedScenes.get(found.poses[k]);
          const poses = hand?.poses ?? found.poses[k];
          if (!poses || !all.includes(k)) continue;
          if (drawn.get(button) !== poses) button.classList.remove("drawn"); // not the picture of another scene
          wanted.push({ canvas, poses, bases: hand && !found.motions ? hand.report.bases[0] : found.bases[k], done: () => (button.classList.add("drawn"), drawn.set(button, poses)) });
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
  const now = spec.value, found = result.value;
  const all = shown.value;
  void moves.value;
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
    <div ref={root} class={`grid ${layout.value}${preview.value ? " early" : wrong.value || outdated.value ? " behind" : ""}`} role="listbox" aria-label={`${what}s`} tabIndex={-1} onKeyDown={keys}>
      {now && found
        ? all.map((k) => {
            const hand = movedScenes.get(found.poses[k])?.report;
            const each = hand ? Object.fromEntries(Object.entries(hand.phi).map(([name, values]) => [name, values[0]])) : Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, values[k]]));
            const phi = label.value === "require" ? (hand ? hand.require?.[0] : found.require?.[k]) : each[label.value];
            return (
              <button key={k} role="option" data-scene={k} aria-selected={k === selected.value} tabIndex={k === selected.value ? 0 : -1} onClick={() => select(k)} onDblClick={() => (layout.value = "one")} onMouseEnter={found.motions ? playSmall(k) : undefined} onMouseLeave={found.motions ? lastAgain(k) : undefined} aria-label={`${what} ${k + 1}, ${label.value} ${phi === undefined ? "" : signed(phi)}`}>
                <canvas width={128} height={96} />
                <span class={phi === undefined ? "" : phi >= 0 ? "good" : "bad"} data-phi={JSON.stringify(each)}>{phi !== undefined ? signed(phi) : hand ? "?" : ""}{hand ? " ✎" : ""}</span>
              </button>
            );
          })
        : null}
      {!all.length && found ? <p class="empty">{preview.value ? `None of the ${what}s so far lies in these ranges; more are being sampled.` : `No ${what} lies in these ranges.`}</p> : null}
    </div>
  );
}

function columns(root: HTMLElement): number {
  return getComputedStyle(root).gridTemplateColumns.split(" ").length;
}

