// The keyboard, outside the editor.
import { editor } from "./editor/editor";
import { picture } from "./focus";
import { closeReader } from "./panels/Reader";
import { closeCode, explained, reading } from "./reader";
import { openMenu, menu, saveOrAsk } from "./panels/TopBar";
import { endTour, tour, welcome } from "./panels/Welcome";
import { asking, table } from "./panels/Stage";
import { stepBy, timed, toEnd } from "./motions";
import { hold, moved, place, play, putOn } from "./hands";
import { band, justSolved } from "./rare";
import { alone, heat, help, layout, movable, names, pane, poses, spec, tab, thing, view } from "./state";
import { next, putBack, redo, sample, step, undo } from "./store";
import { toggleTheme } from "./theme";

export const KEYS: [string, string][] = [
  ["e", "to the editor; F6 leaves it, for the keys below"],
  ["Ctrl S", "save the spec"],
  ["Shift Alt F", "format the spec"],
  ["F12, Ctrl click", "go to the definition"],
  ["Ctrl Space", "complete"],
  ["[ ]", "previous, next scene"],
  ["n", "new scenes, with the next seed"],
  ["x", "the 10 % of scenes with the lowest phi"],
  ["j", "barely satisfied"],
  ["Enter", "sample again, with the kept objects in place"],
  ["s", "select the next object (Shift: the previous one)"],
  ["← → ↑ ↓", "move it by 1 cm (Shift: 5 cm, Alt: 1 mm)"],
  [", .", "turn it by 5° (Alt: 1°)"],
  ["h", "keep it in place in new scenes, or not"],
  ["u", "put it onto the next of its surfaces"],
  ["Ctrl Z, Ctrl Y", "outside the editor: take back the last move of an object, do it again"],
  ["z", "put the scene back as it was sampled"],
  ["space, p", "play a motion, or stop it"],
  ["← →", "of a motion, without a selected object: one step back or forward (Shift: five steps)"],
  ["Home End", "its first moment, its last"],
  ["v", "3D or from above"],
  ["a d w", "without a selected object: turn the camera; + − 0 zoom"],
  ["g", "many scenes or one"],
  ["l m", "names, heat map"],
  ["1 2 3 4", "request, why, where, motion"],
  ["o", "open a spec"],
  ["y", "examples with pictures"],
  ["k", "download: files, command, link"],
  ["t", "light or dark"],
];

let resting: ReturnType<typeof setTimeout> | undefined;

function nudge(event: KeyboardEvent, dx: number, dy: number, turn: number): boolean {
  const name = thing.value;
  const now = spec.value;
  if (now?.time && dx && (!name || alone)) {
    stepBy(dx * (event.shiftKey ? 5 : 1));
    return true;
  }
  if (!name || !now || !movable.value) return false;
  const index = now.objects.findIndex((one) => one.name === name);
  if (index < 0) return false;
  const [x, y, theta] = poses.value[index];
  const size = event.altKey ? 0.001 : event.shiftKey ? 0.05 : 0.01;
  const angle = ((event.altKey ? 1 : 5) * Math.PI) / 180;
  place(name, turn ? { theta: theta + turn * angle } : { x: x + dx * size, y: y + dy * size });
  clearTimeout(resting);
  resting = setTimeout(() => void moved(), 600);
  return true;
}

function cycle(by: number): void {
  const all = spec.value?.objects ?? [];
  if (!all.length) return;
  const at = all.findIndex((one) => one.name === thing.value);
  thing.value = all[at < 0 ? (by > 0 ? 0 : all.length - 1) : (at + by + all.length) % all.length].name;
}

const PLAIN: Record<string, (event: KeyboardEvent) => void | boolean> = {
  e: () => editor.focus(),
  "[": () => step(-1),
  "]": () => step(1),
  n: () => next(),
  x: () => band("hard"),
  j: () => justSolved(),
  Enter: () => void sample(),
  s: () => cycle(1),
  S: () => cycle(-1),
  h: () => void (thing.value && hold(thing.value)),
  u: () => void (thing.value && putOn(thing.value)),
  z: () => void (movable.value && putBack()),
  p: () => play(),
  v: () => void (view.value = view.value === "3d" ? "top" : "3d"),
  g: () => void (layout.value = layout.value === "many" ? "one" : "many"),
  l: () => void (names.value = !names.value),
  m: () => void (heat.value = !heat.value),
  " ": () => (timed.value ? play() : false),
  Home: () => (timed.value ? toEnd("first") : false),
  End: () => (timed.value ? toEnd("last") : false),
  "1": () => void ((tab.value = "request"), (pane.value = "panel")),
  "2": () => void ((tab.value = "why"), (pane.value = "panel")),
  "3": () => void ((tab.value = "where"), (pane.value = "panel")),
  "4": () => void ((tab.value = "motion"), (pane.value = "panel")),
  o: () => void (alone || openMenu("file")),
  y: () => void (welcome.value = !alone),
  k: () => openMenu("take"),
  t: () => toggleTheme(),
  "?": () => void (help.value = !help.value),
  "+": () => table?.orbit(0, 0, 0.85),
  "-": () => table?.orbit(0, 0, 1.18),
  "0": () => table?.reset(),
  a: () => table?.orbit(-0.12, 0),
  d: () => table?.orbit(0.12, 0),
  w: () => table?.orbit(0, 0.08),
  ArrowLeft: (event) => nudge(event, -1, 0, 0),
  ArrowRight: (event) => nudge(event, 1, 0, 0),
  ArrowUp: (event) => nudge(event, 0, 1, 0),
  ArrowDown: (event) => nudge(event, 0, -1, 0),
  ",": (event) => nudge(event, 0, 0, 1),
  ".": (event) => nudge(event, 0, 0, -1),
};

/** Close what lies over the page; returns whether there was anything. */
function closeTop(): boolean {
  if (tour.value >= 0) endTour();
  else if (help.value) help.value = false;
  else if (explained.value) closeCode();
  else if (reading.value) closeReader();
  else if (menu.value) menu.value = "";
  else if (asking.value) asking.value = false;
  else return false;
  return true;
}

export function listen(): void {
  // Whose focus was lost from the editor by itself goes on typing there; who left it has the keys of the page.
  let left = true;
  const leave = (event: Event) => (left = !(event.target as HTMLElement).closest(".editor > .code"));
  addEventListener("focusin", leave);
  addEventListener("pointerdown", leave, true);
  addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    const inEditor = !!target.closest(".cm-editor");
    const control = event.ctrlKey || event.metaKey;
    if (control && event.key.toLowerCase() === "s") {
      event.preventDefault();
      if (!alone) void saveOrAsk();
      return;
    }
    if (event.key === "F6" && !help.value) {
      event.preventDefault();
      if (inEditor) picture()?.focus();
      else editor.focus();
      return;
    }
    if (event.defaultPrevented && !target.closest(".reader .cm-content")) return; // the editor took it: Esc closed its list of words
    if (event.key === "Escape") {
      if (!closeTop() && !inEditor) thing.value = null;
      return;
    }
    const typing = target.closest(".cm-editor, input:not([type=range]), select, textarea, .menu");
    if (control && /^[zy]$/i.test(event.key) && movable.value && !target.closest(".cm-editor, input:not([type=range]), textarea")) {
      event.preventDefault();
      if (event.shiftKey || event.key.toLowerCase() === "y") redo();
      else undo();
      return;
    }
    if (typing || control) return;
    // A button that is focused keeps Enter and space for itself; options and sliders their arrows.
    if ((event.key === "Enter" || event.key === " ") && target.closest("button, a, [role=slider]")) return;
    if (/^Arrow|^Home$|^End$/.test(event.key) && target.closest("[role=slider], [role=listbox], input, [role=tablist]")) return;
    if (!left && !alone && target === document.body) {
      if (event.key.length === 1 || event.key === "Backspace") editor.focus(); // which gets the key itself, too
      return;
    }
    const done = PLAIN[event.key] ?? (event.altKey ? PLAIN[event.code === "Comma" ? "," : event.code === "Period" ? "." : ""] : undefined);
    if (!done) return;
    if (done(event) !== false) event.preventDefault();
  });
}
