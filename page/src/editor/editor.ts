// The editor: CodeMirror with the features of the language server.
import { acceptCompletion, autocompletion, closeCompletion, completionKeymap, currentCompletions, selectedCompletion, selectedCompletionIndex, type Completion, type CompletionContext, type CompletionResult } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyField, historyKeymap, toggleComment } from "@codemirror/commands";
import { bracketMatching } from "@codemirror/language";
import { lintKeymap, setDiagnostics } from "@codemirror/lint";
import { highlightSelectionMatches, search, searchKeymap } from "@codemirror/search";
import { EditorState, StateEffect, StateField, type Extension } from "@codemirror/state";
import { closeHoverTooltips, Decoration, drawSelection, EditorView, hasHoverTooltips, highlightActiveLine, highlightActiveLineGutter, hoverTooltip, keymap, lineNumbers, tooltips, type DecorationSet } from "@codemirror/view";
import { effect } from "@preact/signals";
import { explainCode, read } from "../reader";
import { askOne, http, onReconnect, tabId, token } from "../server";
import { alone, boot, decides, message, offered, pointed, problems, report, restored, saved, spec, text, unsaved, type Saved } from "../state";
import { setText } from "../store";
import type { Draft, Line, Problem } from "../types";
import { callFields, inCall, insertCall, leap, onBlank } from "./calls";
import { specLanguage } from "./language";
import { lightNames } from "./light";
import { markdown } from "./markdown";

const KEPT = `scenegen.editor.${token}`; // in the session of the tab: two tabs keep two texts

const setMarks = StateEffect.define<{ from: number; to: number; kind: string }[]>();
const marks = StateField.define<DecorationSet>({
  create: () => Decoration.none,
  update(value, change) {
    value = value.map(change.changes);
    for (const one of change.effects)
      if (one.is(setMarks)) {
        const most = change.newDoc.length;
        const found = one.value.filter((mark) => mark.from < mark.to && mark.to <= most);
        value = Decoration.set(
          found.map((mark) => Decoration.mark({ class: `cm-${mark.kind}` }).range(mark.from, mark.to)),
          true,
        );
      }
    return value;
  },
  provide: (field) => EditorView.decorations.from(field),
});

export let editor: EditorView;

/** An offset in characters as one in UTF-16 units, which CodeMirror counts in. */
export function units(value: string, offset: number): number {
  if (!/[\ud800-\udbff]/.test(value)) return offset;
  return [...value].slice(0, offset).join("").length;
}

function position(state: EditorState, offset: number): { line: number; character: number } {
  const line = state.doc.lineAt(offset);
  return { line: line.number - 1, character: offset - line.from };
}

function offset(state: EditorState, place: { line: number; character: number }): number {
  if (place.line >= state.doc.lines) return state.doc.length;
  const line = state.doc.line(place.line + 1);
  return Math.min(line.from + place.character, line.to);
}

function assist<T>(state: EditorState, feature: string, at: number): Promise<T> {
  return askOne<T>("assist", { text: state.doc.toString(), path: saved.value.path, feature, ...position(state, at) });
}

const KINDS: Record<number, string> = {
  14: "keyword", 3: "function", 10: "property", 11: "unit", 20: "enum", 5: "property", 17: "file", 6: "variable", 22: "region", 21: "constant", 23: "label", 25: "variable",
};

async function complete(context: CompletionContext): Promise<CompletionResult | null> {
  const word = context.matchBefore(/[A-Za-z_]\w*/);
  const before = context.state.sliceDoc(Math.max(0, context.pos - 1), context.pos);
  if (!context.explicit && !word && before !== "." && before !== '"') return null;
  asked = context.explicit;
  try {
    const found = await assist<{ items: any[] } | null>(context.state, "completion", context.pos);
    if (!found?.items.length) return null;
    const first = found.items[0].textEdit.range;
    return {
      from: offset(context.state, first.start),
      options: found.items.map((one, order) => ({
        label: one.label,
        type: KINDS[one.kind] ?? "variable",
        detail: one.detail && one.detail !== one.label ? one.detail : undefined,
        info: one.documentation || undefined,
        boost: -Math.min(99, order / 20 + one.label.length / 2), // of those that fit as well: the shorter
        apply: called(one),
      })),
      validFor: /^\w*$/,
    };
  } catch {
    return null;
  }
}

/** What a relation puts in: with its arguments as fields to fill in, and those that may be left out left out. */
function called(one: { label: string; detail?: string; kind: number }) {
  const args = one.kind === 3 ? one.detail?.match(/^\w+\((.*)\)$/)?.[1] : undefined;
  const needed = args?.split(",").map((arg) => arg.trim()).filter((arg) => /^\w+$/.test(arg)) ?? [];
  if (!needed.length) return undefined;
  return (view: EditorView, completion: Completion, from: number, to: number) => {
    if (view.state.sliceDoc(to, to + 1) === "(") view.dispatch({ changes: { from, to, insert: one.label }, selection: { anchor: from + one.label.length } });
    else insertCall(view, completion, one.label, needed, from, to);
  };
}

/** What a message says to write instead. */
export function mends(one: Problem): { name: string; apply: (view: EditorView) => void }[] {
  const better = one.message.match(/did you mean `([^`]+)`/)?.[1], more = one.message.match(/help: write `(require [^`]+)`/)?.[1];
  const change = (find: (state: EditorState) => { from: number; to: number; insert: string }) => (view: EditorView) => {
    view.dispatch({ changes: find(view.state), userEvent: "mend" });
    view.focus();
  };
  if (better)
    return [{ name: `Change to ${better}`, apply: change((state) => ({ from: offset(state, one.range.start), to: offset(state, one.range.end), insert: better })) }];
  if (more)
    return [{ name: `Add ${more}`, apply: change((state) => {
      const at = lastRequirement(state) ?? state.doc.lineAt(offset(state, one.range.end)).to;
      return { from: at, to: at, insert: `\n${more}` };
    }) }];
  return [];
}

/** The end of the last requirement, where further ones belong. */
function lastRequirement(state: EditorState): number | null {
  let found: number | null = null, inside = false;
  for (let number = 1; number <= state.doc.lines; number++) {
    const line = state.doc.line(number);
    if (!/^\s/.test(line.text)) inside = /^require\b/.test(line.text);
    if (inside && line.text.trim()) found = line.to;
  }
  return found;
}

let asked = false; // the list of words was opened by a key

const LISTS = /^object\b/; // statements in which the last word of a line may be a new name

/** Whether the chosen option was meant: one that somebody went to, or the first where the word is no name by itself. What
 * is typed stays what it is. */
function meant(view: EditorView): boolean {
  const chosen = selectedCompletion(view.state);
  if (!chosen) return false;
  const { doc, selection } = view.state;
  const line = doc.lineAt(selection.main.head);
  const word = /\w*$/.exec(line.text.slice(0, selection.main.head - line.from))![0];
  let first = line; // of the statement
  while (first.number > 1 && /^\s/.test(first.text)) first = doc.line(first.number - 1);
  const whole = currentCompletions(view.state).some((one) => one.label === word) || LISTS.test(first.text);
  return (chosen.label !== word && (asked || !!selectedCompletionIndex(view.state))) || !whole;
}

function enter(view: EditorView): boolean {
  if (meant(view)) return acceptCompletion(view);
  closeCompletion(view);
  return false;
}

/** Tab takes a word and goes through the arguments of a call. It never leaves the editor: what is typed next would be lost. */
function tab(view: EditorView): boolean {
  if (inCall(view.state) ? meant(view) && acceptCompletion(view) : acceptCompletion(view)) return true;
  if (!leap(view)) message.value = "F6 leaves the editor";
  return true;
}

function closeHovers(view: EditorView): boolean {
  if (!hasHoverTooltips(view.state)) return false;
  view.dispatch({ effects: closeHoverTooltips });
  return true;
}

const hovers = hoverTooltip(async (view, at) => {
  try {
    const found = await assist<{ contents: { value: string }; range: any } | null>(view.state, "hover", at);
    if (!found) return null;
    return {
      pos: offset(view.state, found.range.start),
      end: offset(view.state, found.range.end),
      above: true,
      create() {
        const dom = document.createElement("div");
        dom.className = "cm-hover";
        dom.append(markdown(found.contents.value));
        return { dom };
      },
    };
  } catch {
    return null;
  }
}, { hoverTime: 350 });

export async function define(view: EditorView = editor, at = view.state.selection.main.head): Promise<boolean> {
  try {
    const found = await assist<{ name: string; path: string | null; prelude: boolean; range: any } | null>(view.state, "definition", at);
    if (!found) {
      message.value = "nothing is defined there";
      return true;
    }
    if (found.path !== (saved.value.path ?? "untitled.spec")) {
      await read(found);
      return true;
    }
    const from = offset(view.state, found.range.start);
    view.dispatch({ selection: { anchor: from, head: offset(view.state, found.range.end) }, effects: EditorView.scrollIntoView(from, { y: "center" }) });
    view.focus();
  } catch {
    /* a newer question took its place */
  }
  return true;
}

export async function format(view: EditorView = editor): Promise<void> {
  const state = view.state;
  const found = await assist<{ range: any; newText: string }[] | null>(state, "formatting", 0).catch(() => null);
  if (!found || !view.state.doc.eq(state.doc)) return; // squiggles that came meanwhile change the state, not the text
  if (!found.length) message.value = "nothing to format: correct the mistakes first, or the spec is formatted already";
  view.dispatch({
    changes: found.map((one) => ({ from: offset(state, one.range.start), to: offset(state, one.range.end), insert: one.newText })),
    userEvent: "format",
  });
}

const theme = EditorView.theme({
  "&": { fontSize: "12.5px", backgroundColor: "transparent", color: "var(--ink)" },
  "&.cm-editor": { height: "100%" }, // the box of hover texts has the theme, too
  ".cm-blank": { backgroundColor: "var(--selection)", borderRadius: "3px" },
  ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.6" },
  ".cm-content": { caretColor: "var(--accent)", padding: "10px 0 40px" },
  ".cm-gutters": { backgroundColor: "transparent", color: "var(--quiet)", border: "none", paddingLeft: "6px" },
  ".cm-activeLine": { backgroundColor: "var(--line-active)" },
  ".cm-activeLineGutter": { backgroundColor: "transparent", color: "var(--ink)" },
  "&.cm-focused": { outline: "none" },
  "&.cm-focused .cm-cursor": { borderLeftColor: "var(--accent)", borderLeftWidth: "2px" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": { backgroundColor: "var(--selection) !important" },
  ".cm-tooltip": { backgroundColor: "var(--raised)", color: "var(--ink)", border: "1px solid var(--edge)", borderRadius: "8px", boxShadow: "var(--shadow)" },
  ".cm-tooltip-autocomplete > ul > li[aria-selected]": { backgroundColor: "var(--accent)", color: "var(--on-accent)" },
  ".cm-panels": { backgroundColor: "var(--raised)", color: "var(--ink)" },
  ".cm-panels-top": { borderBottom: "1px solid var(--edge)" },
});

function extensions(): Extension[] {
  return [
    lineNumbers(),
    highlightActiveLineGutter(),
    history(),
    drawSelection(),
    EditorState.allowMultipleSelections.of(true),
    bracketMatching(),
    highlightActiveLine(),
    highlightSelectionMatches({ minSelectionLength: 2 }),
    search({ top: true }),
    specLanguage(),
    lightNames,
    theme,
    marks,
    EditorView.lineWrapping,
    EditorView.contentAttributes.of({ "aria-label": "spec", spellcheck: "false" }),
    alone ? EditorState.readOnly.of(true) : [autocompletion({ override: [complete], icons: false, defaultKeymap: false }), callFields, hovers, keymap.of([{ key: "Tab", run: tab, shift: () => true }])],
    tooltips({ position: "fixed", parent: document.body }),
    keymap.of([
      { key: "F12", run: (view) => (void define(view), true) },
      { key: "Shift-Alt-f", run: (view) => (void format(view), true) },
      { key: "Mod-/", run: toggleComment },
      { key: "Enter", run: enter },
      { key: "Escape", run: (view) => closeHovers(view) || onBlank(view.state) }, // which stays selected
      ...defaultKeymap.filter((one) => one.key !== "Mod-/"),
      ...searchKeymap,
      ...historyKeymap,
      ...completionKeymap.filter((one) => one.key !== "Enter"),
      ...lintKeymap,
    ]),
    EditorView.updateListener.of((update) => {
      if (update.docChanged) {
        touched = true;
        setText(update.state.doc.toString());
        keep();
      }
    }),
    EditorView.domEventHandlers({
      mousedown(event, view) {
        if (!(event.ctrlKey || event.metaKey) || alone) return false;
        const at = view.posAtCoords({ x: event.clientX, y: event.clientY });
        if (at === null) return false;
        event.preventDefault();
        void define(view, at);
        return true;
      },
    }),
  ];
}

/** The state of an editor in which a file is only read. */
export function readOnlyState(doc: string, name: string): EditorState {
  const named = EditorView.contentAttributes.of({ "aria-label": name, "aria-readonly": "true", spellcheck: "false" });
  return EditorState.create({ doc, extensions: [lineNumbers(), drawSelection(), highlightActiveLine(), search({ top: true }), specLanguage(), theme, EditorView.lineWrapping, EditorState.readOnly.of(true), named, keymap.of([...defaultKeymap, ...searchKeymap])] });
}

let keeping: ReturnType<typeof setTimeout> | undefined;
const OFTEN = 400; // ms

/** The text and its undo history survive a reload of the tab. */
function keep(): void {
  keeping ??= setTimeout(keepNow, OFTEN);
}

export function keepNow(): void {
  clearTimeout(keeping);
  keeping = undefined;
  if (alone || !editor) return;
  try {
    sessionStorage.setItem(KEPT, JSON.stringify({ state: editor.state.toJSON({ history: historyField }), saved: saved.value, tab: tabId, focus: editor.hasFocus }));
  } catch {
    /* there is no room: the history is lost with the tab */
  }
  keepDraft();
}

const MOST_DRAFT = 256 * 1024; // as a spec on the page has at most

let drafted = { name: "", body: "" }; // what the server keeps of the file that is open
let touched = false; // whether anything was written in it in this tab
/** What is open is in no file any more: it is kept, whoever wrote it. */
export function keepOrphan(): void {
  touched = true;
  keepNow();
}

let instead: string | null = null; // the closed tab whose draft goes on in this one

/** What is not saved is kept by the server: it outlives the tab, and the server itself. Each tab has its own. */
function keepDraft(): void {
  const { path, sha } = saved.value, name = path ?? saved.value.name;
  const body = JSON.stringify({ name, text: unsaved.value ? text.value : null, was: sha, tab: tabId, instead });
  if (!touched || body === drafted.body || body.length > MOST_DRAFT) return;
  const put = (body: string) =>
    http("/api/draft", { method: "PUT", body, keepalive: body.length < 60_000 }).catch((error) => {
      if (drafted.body === body) drafted.body = ""; // once more with the next change
      message.value = error.message;
    });
  if (drafted.name && drafted.name !== name) void put(JSON.stringify({ name: drafted.name, text: null, was: null, tab: tabId })); // saved under another name
  drafted = { name, body };
  void put(body);
}
onReconnect(() => {
  drafted.body = "";
  keepNow();
});

/** Text takes the place of all there is; it can be undone. */
export function replaceText(value: string): void {
  editor.dispatch({ changes: { from: 0, to: editor.state.doc.length, insert: value }, userEvent: "open" });
}

/** What was written before and not saved, in the place of what is saved. */
function restore(draft: Draft | null | undefined): void {
  if (draft) instead = draft.tab;
  restored.value = !!draft && draft.text !== text.value;
  if (!restored.value) return;
  saved.value = { ...saved.value, sha: draft!.was };
  replaceText(draft!.text);
}

/** Go on with what was written earlier in the example that is open. */
export function takeUp(): void {
  restore(offered.value);
  offered.value = null;
  editor.focus();
}

export function mountEditor(parent: HTMLElement, fresh: boolean): void {
  let state: EditorState | null = null, kept: { state: any; saved: Saved; tab: string; focus: boolean } | null = null;
  const before = fresh || alone ? null : sessionStorage.getItem(KEPT);
  if (before)
    try {
      kept = JSON.parse(before)!;
      state = EditorState.fromJSON(kept!.state, { extensions: extensions() }, { history: historyField });
      saved.value = kept!.saved;
    } catch {
      state = null;
    }
  const opened = !state;
  state ??= EditorState.create({ doc: text.value, extensions: extensions() });
  editor = new EditorView({ state, parent });
  text.value = editor.state.doc.toString();
  if (opened && !fresh && !alone) restore(boot.draft);
  else if (kept && unsaved.value) {
    touched = true;
    instead = kept.tab;
    keep();
  }
  if (kept?.focus) editor.focus();
  // Esc, Tab leaves an editor otherwise, and what is typed then is lost. Captured: the editor asks itself first.
  if (!alone) parent.addEventListener("keydown", (event) => event.key === "Tab" && editor.setTabFocusMode(false), true);
  addEventListener("pagehide", keepNow);
  addEventListener("beforeunload", (event) => {
    if (unsaved.value && !alone) event.preventDefault();
  });
  effect(() => {
    if (!unsaved.value) restored.value = false;
  });

  effect(() => {
    const found = problems.value.map((one) => ({
      from: offset(editor.state, one.range.start),
      to: Math.max(offset(editor.state, one.range.end), offset(editor.state, one.range.start)),
      severity: one.severity === 1 ? ("error" as const) : ("warning" as const),
      message: one.message,
      actions: [...mends(one), ...(one.code ? [{ name: "What does this mean?", apply: () => void explainCode(one.code!, true) }] : [])],
    }));
    editor.dispatch(setDiagnostics(editor.state, found));
  });
  effect(() => {
    const found: { from: number; to: number; kind: string }[] = [];
    const whole = text.peek();
    const add = (span: [number, number] | undefined, kind: string) => {
      if (span) found.push({ from: units(whole, span[0]), to: units(whole, span[1]), kind });
    };
    const one = decides.value;
    if (one && report.value) add(one.spans[one.spans.length - 1], one.value >= 0 ? "decides" : "decides-bad");
    if (pointed.value !== null && spec.value) add(spansOf(pointed.value), "pointed");
    editor.dispatch({ effects: setMarks.of(found) });
  });
}

function spansOf(number: number): [number, number] | undefined {
  const stack: Line[] = Object.values(spec.value!.trees);
  while (stack.length) {
    const one = stack.pop()!;
    if (one.line === number) {
      if (one.spans.length) return one.spans[one.spans.length - 1];
      const spans: [number, number][] = [];
      const below = [...one.parts];
      while (below.length) {
        const part = below.pop()!;
        if (part.spans.length) spans.push(part.spans[part.spans.length - 1]);
        below.push(...part.parts);
      }
      return spans.length ? [Math.min(...spans.map((two) => two[0])), Math.max(...spans.map((two) => two[1]))] : undefined;
    }
    stack.push(...one.parts);
  }
  return undefined;
}

const key = ({ path, name }: Saved) => path ?? `\0${name}`;
const states = new Map<string, { state: EditorState; file: Saved; instead: string | null }>(); // of files with what was not saved

/** The names of texts that no file has, written in this tab and not open now. */
export function waitingTexts(): string[] {
  return [...states.values()].map(({ file }) => file).filter((file) => file.path === null && key(file) !== key(saved.value)).map(({ name }) => name);
}

/** A name under which no text that is not saved waits: an example is opened as it is, beside what was made of it. */
export function freshName(name: string): string {
  const taken = (one: string) => states.has(`\0${one}`) || (saved.value.path === null && saved.value.name === one && unsaved.value);
  let found = name;
  for (let k = 2; taken(found); k++) found = `${name}-${k}`;
  return found;
}

/** Another file takes the place of the one that is open. Each has its own history: undo never leaves a file. What is
 * written there without having been saved is there again when the file is opened again. */
export function openInEditor(file: Saved, draft: Draft | null): void {
  keepNow();
  if (unsaved.value) states.set(key(saved.value), { state: editor.state, file: saved.value, instead });
  else states.delete(key(saved.value));
  const before = states.get(key(file));
  states.delete(key(file)); // it is open
  saved.value = before?.file ?? file; // its hash, too: what is on the disk may be newer than what was written here
  editor.setState(before?.state ?? EditorState.create({ doc: file.text ?? "", extensions: extensions() }));
  drafted = { name: "", body: "" };
  touched = false;
  instead = before?.instead ?? null;
  restored.value = !!before;
  offered.value = null;
  setText(editor.state.doc.toString());
  if (!before && (file.path || file.text === null)) restore(draft);
  else if (!before && draft && draft.text !== file.text) offered.value = draft;
  keepNow();
}
