// The first screen, examples with pictures by topic; and a short tour of the page.
import { signal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { editor } from "../editor/editor";
import { list, openText, type Listing } from "../files";
import { useFocusBack } from "../focus";
import { help, message, pane, tab } from "../state";

export const welcome = signal(false);
export const tour = signal(-1); // the step that is shown; -1: none

// Topic -> shipped specs. One that is in no topic stands under the last.
const TOPICS: [string, string[]][] = [
  ["Learn the language", ["first", "mug_left_of_plate", "breakfast", "sort_3", "block_tower"]],
  ["Set a table", ["dinner_for_two", "table_setting", "tea_party", "morning_table", "sushi_plate", "fruit_bowl"]],
  ["Desk and workshop", ["tidy_desk", "office_desk", "book_corner", "medical_tray", "toolbox_drawer"]],
  ["Shelves, drawers, bins", ["wall_shelf", "pantry_shelf", "shop_shelf", "put_away", "bottle_rack", "cutlery_drawer", "cutlery_tray", "packing_tray", "sorting_bins", "recycling", "served_pot"]],
  ["Robots and cameras", ["graspable_pick", "robot_placement", "occlusion_ladder"]],
  ["More", ["chess_corner", "sort_5", "sort_7", "sort_7_quantified", "table_setting_published"]],
];

const EMPTY = "# What must hold in the scene: try rightOf, closeTo, on, angle, noOverlap ...\nobject mug, plate\n\nrequire noOverlap()\n\ntask: leftOf(mug, plate)\n";

function Modal({ name, onClose, children }: { name: string; onClose: () => void; children: any }) {
  const root = useRef<HTMLDialogElement>(null);
  useFocusBack();
  useLayoutEffect(() => root.current!.showModal(), []); // keeps Tab inside, closes with Esc
  return (
    <dialog ref={root} class="welcome" aria-label={name} onClose={onClose} onKeyDown={(event) => event.stopPropagation()} onClick={(event) => event.target === root.current && root.current!.close()}>
      {children}
    </dialog>
  );
}

export function Welcome() {
  const [found, setFound] = useState<Listing | null>(null);
  useEffect(() => void list().then(setFound, (error) => (message.value = error.message)), []);
  const leave = () => (welcome.value = false);
  const shipped = new Map((found?.shipped ?? []).map((one) => [one.name, one]));
  const placed = new Set(TOPICS.flatMap(([, names]) => names));
  const topics = TOPICS.map(([topic, names], k) => [topic, k === TOPICS.length - 1 ? [...names, ...[...shipped.keys()].filter((name) => !placed.has(name))] : names] as const);
  return (
    <Modal name="examples" onClose={leave}>
      <header>
        <div>
          <h2>Scenes from a text</h2>
          <p>Write what must hold on a table. scenegen samples scenes that satisfy it, barely satisfy it, or fail to, as you choose.</p>
        </div>
        <span class="buttons">
          <button class="strong" onClick={() => { leave(); tour.value = 0; }}>Take the tour</button>
          <button onClick={() => { leave(); void openText("scene", EMPTY, false).then(() => editor.focus()); }}>Start a new spec</button>
          <button onClick={leave}>Close <kbd>Esc</kbd></button>
        </span>
      </header>
      {found && topics.map(([topic, names]) => (
        <section key={topic} aria-label={topic}>
          <h3>{topic}</h3>
          <div class="cards">
            {names.filter((name) => shipped.has(name)).map((name) => (
              <button key={name} class="card" data-example={name} onClick={() => { leave(); void openText(name, shipped.get(name)!.text); }}>
                <img src={`/static/examples/${name}.jpg`} alt="" loading="lazy" width="240" height="150" />
                <b>{name.replaceAll("_", " ")}</b>
                <small>{shipped.get(name)!.title}</small>
              </button>
            ))}
          </div>
        </section>
      ))}
    </Modal>
  );
}

interface Step {
  at: string; // what it is about, as a selector
  title: string;
  words: string;
  show: () => void;
}

const STEPS: Step[] = [
  { at: ".editor .code", title: "1. Write", words: "This text says which objects there are and what must hold. Change a number, or type a new line: the scenes follow while you type.", show: () => (pane.value = "spec") },
  { at: ".stage", title: "2. Look and drag", words: "One of the scenes sampled for the text. Drag an object: phi says by how much the formula is satisfied. It is satisfied where phi is at least 0.", show: () => (pane.value = "scenes") },
  { at: ".panel", title: "3. Pull a handle", words: "Each label has two handles: the range of phi that you want. Further left, scenes are farther from satisfying the formula. The curve says how rare a phi is.", show: () => { tab.value = "request"; pane.value = "panel"; } },
  { at: ".panel", title: "4. Ask why", words: "The formula as a tree, with the value of each part in this scene. The framed part sets phi; it is underlined in the text and drawn in the scene.", show: () => { tab.value = "why"; pane.value = "panel"; } },
  { at: ".bar", title: "5. Download", words: "Download has the scenes as files for Python and for simulators, and the command that makes as many of them as you like.", show: () => (pane.value = "scenes") },
];

export function endTour(): void {
  tour.value = -1;
  tab.value = "request";
}

export function Tour() {
  return STEPS[tour.value] ? <Steps /> : null;
}

function Steps() {
  const step = STEPS[tour.value];
  const box = useRef<HTMLElement>(null);
  const [place, setPlace] = useState<DOMRect | null>(null);
  useFocusBack();
  useEffect(() => {
    if (!step) return;
    step.show();
    const measure = () => setPlace(document.querySelector(step.at)?.getBoundingClientRect() ?? null);
    const later = requestAnimationFrame(measure); // once the part that it is about is in sight
    box.current?.focus();
    addEventListener("resize", measure);
    return () => {
      cancelAnimationFrame(later);
      removeEventListener("resize", measure);
    };
  }, [tour.value]);
  if (!step) return null;
  const go = (by: number) => (tour.value + by < STEPS.length ? (tour.value += by) : endTour());
  return (
    <>
      {place ? <div class="ring" style={`left: ${place.left + 3}px; top: ${place.top + 3}px; width: ${place.width - 6}px; height: ${place.height - 6}px`} /> : null}
      <section ref={box} class="tour" tabIndex={-1} aria-label="tour">
        <h2>{step.title}</h2>
        <p aria-live="polite">{step.words}</p>
        <footer>
          {tour.value < STEPS.length - 1 ? <button onClick={endTour}>End the tour</button> : <button onClick={() => { endTour(); welcome.value = true; }}>Examples</button>}
          <span class="buttons">
            <button disabled={!tour.value} onClick={() => go(-1)}>Back</button>
            <button class="strong" onClick={() => go(1)}>{tour.value < STEPS.length - 1 ? "Next" : "Done"}</button>
          </span>
        </footer>
      </section>
    </>
  );
}

/** What the help offers besides the keys. */
export function Offers() {
  return (
    <p class="offers">
      <button class="chip" onClick={() => { help.value = false; tour.value = 0; }}>Take the tour</button>
      <button class="chip" onClick={() => { help.value = false; welcome.value = true; }}>Examples</button>
    </p>
  );
}
