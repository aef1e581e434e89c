// Names of objects in the text: the one under the pointer lights its object, and is lit with it wherever it stands.
import { effect } from "@preact/signals";
import type { Extension } from "@codemirror/state";
import { Decoration, EditorView, ViewPlugin, type DecorationSet, type ViewUpdate } from "@codemirror/view";
import { lit, spec } from "../state";

const NAME = /[A-Za-z_]\w*(?:\[\d+\])?/g;
const MARK = Decoration.mark({ class: "cm-lit" });

/** The names in a line, outside comments, with their places. In `object book[2]` the number is how many there are. */
function namesIn(line: string): { word: string; index: number }[] {
  const code = line.split("#")[0];
  return [...code.matchAll(NAME)].map(({ 0: word, index }) => {
    const before = code.slice(0, index);
    const declares = /^\s*object\b/.test(code) && /(object|,)\s*$/.test(before) && before.split("[").length === before.split("]").length;
    return { word: declares ? word.split("[")[0] : word, index };
  });
}

/** The object whose name is at a place of the text. */
function objectAt(view: EditorView, at: number): string | null {
  const line = view.state.doc.lineAt(at);
  const found = namesIn(line.text).find(({ word, index }) => line.from + index <= at && at < line.from + index + word.length);
  return spec.value?.objects.find((one) => one.name === found?.word)?.name ?? null;
}

/** Every place in sight where the lit object is named. */
function places(view: EditorView): DecorationSet {
  const name = lit.value;
  if (name === null) return Decoration.none;
  const found = [];
  for (const { from, to } of view.visibleRanges)
    for (let at = from; at <= to; ) {
      const line = view.state.doc.lineAt(at);
      for (const { word, index } of namesIn(line.text)) if (word === name || word === name.split("[")[0]) found.push(MARK.range(line.from + index, line.from + index + word.length));
      at = line.to + 1;
    }
  return Decoration.set(found);
}

export const lightNames: Extension = ViewPlugin.fromClass(
  class {
    decorations: DecorationSet = Decoration.none;
    private end: () => void;
    constructor(view: EditorView) {
      let first = true;
      this.end = effect(() => {
        void lit.value;
        if (!first) queueMicrotask(() => view.dispatch()); // an empty step: marks are made anew
        first = false;
      });
    }
    update(update: ViewUpdate): void {
      this.decorations = places(update.view);
    }
    destroy(): void {
      this.end();
    }
  },
  {
    decorations: (plugin) => plugin.decorations,
    eventHandlers: {
      mousemove(event, view) {
        const at = view.posAtCoords({ x: event.clientX, y: event.clientY });
        lit.value = at === null ? null : objectAt(view, at);
      },
      mouseleave() {
        lit.value = null;
      },
    },
  },
);
