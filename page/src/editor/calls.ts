// Calls that completion puts in. Their arguments are fields: what everybody types to go on, `,` and `)`, goes from one to
// the next and out of the last, as Tab does.
import { insertBracket, pickedCompletion, type Completion } from "@codemirror/autocomplete";
import { MapMode, Prec, StateEffect, StateField, Transaction, type ChangeDesc, type EditorState, type Extension } from "@codemirror/state";
import { Decoration, EditorView } from "@codemirror/view";

/** Where the brackets and commas of a call stand, and the arguments that nobody has filled in yet. */
interface Call {
  open: number;
  close: number;
  commas: number[];
  blank: { from: number; to: number }[];
}

const begin = StateEffect.define<Call>();

function moved(call: Call, changes: ChangeDesc): Call | null {
  const at = (place: number) => changes.mapPos(place, 1, MapMode.TrackAfter);
  const open = at(call.open), close = at(call.close);
  if (open === null || close === null) return null;
  const blank = call.blank.filter(({ from, to }) => !changes.touchesRange(from, to));
  return {
    open,
    close,
    commas: call.commas.map(at).filter((one) => one !== null),
    blank: blank.map(({ from, to }) => ({ from: changes.mapPos(from, 1), to: changes.mapPos(to, -1) })),
  };
}

/** The calls that the cursor is in, the innermost last. */
const calls = StateField.define<Call[]>({
  create: () => [],
  update(value, { changes, docChanged, effects, newSelection }) {
    if (docChanged) value = value.map((one) => moved(one, changes)).filter((one) => one !== null);
    for (const one of effects) if (one.is(begin)) value = [...value, one.value];
    const { from, to } = newSelection.main;
    const left = value.filter(({ open, close }) => from > open && to <= close);
    return left.length < value.length ? left : value;
  },
  provide: (field) =>
    EditorView.decorations.from(field, (value) => {
      const blank = value.flatMap((one) => one.blank).filter(({ from, to }) => from < to);
      return Decoration.set(blank.map(({ from, to }) => Decoration.mark({ class: "cm-blank" }).range(from, to)), true);
    }),
});

/** Put in a call with its arguments to fill in. */
export function insertCall(view: EditorView, completion: Completion, name: string, args: string[], from: number, to: number): void {
  const open = from + name.length;
  const commas: number[] = [], blank: Call["blank"] = [];
  let at = open + 1;
  for (const arg of args) {
    blank.push({ from: at, to: at + arg.length });
    commas.push(at + arg.length);
    at += arg.length + 2;
  }
  const close = commas.pop()!;
  view.dispatch({
    changes: { from, to, insert: `${name}(${args.join(", ")})` },
    selection: { anchor: blank[0].from, head: blank[0].to },
    effects: begin.of({ open, close, commas, blank }),
    annotations: [pickedCompletion.of(completion), Transaction.userEvent.of("input.complete")],
    scrollIntoView: true,
  });
}

function innermost(state: EditorState): Call | undefined {
  return state.field(calls).at(-1);
}

function balanced(text: string): boolean {
  return text.split(/[([{]/).length === text.split(/[)\]}]/).length;
}

/** Whether no bracket of what was typed stands open between that of the call and a place. */
function within(state: EditorState, call: Call, at: number): boolean {
  return balanced(state.sliceDoc(call.open + 1, at));
}

export function inCall(state: EditorState): boolean {
  return !!innermost(state);
}

/** Whether an argument that is to be filled in is selected. */
export function onBlank(state: EditorState): boolean {
  const { from, to } = state.selection.main;
  return !!innermost(state)?.blank.some((one) => one.from === from && one.to === to);
}

/** Go to the next argument, and behind the bracket after the last. */
export function leap(view: EditorView): boolean {
  const call = innermost(view.state);
  if (!call) return false;
  const stops = [...call.commas, call.close].filter((one) => one >= view.state.selection.main.to);
  const space = view.state.sliceDoc(stops[0] + 1, stops[0] + 2) === " " ? 2 : 1;
  view.dispatch({ selection: stops.length > 1 ? { anchor: stops[0] + space, head: stops[1] } : { anchor: call.close + 1 }, scrollIntoView: true });
  return true;
}

let spaced = -1; // where a comma has led to, behind its space: one that is typed is there already

const typing = EditorView.inputHandler.of((view, from, to, typed) => {
  const { state } = view;
  const call = innermost(state), there = spaced;
  spaced = -1;
  if (from === to && (typed === ")" || typed === "]") && state.sliceDoc(to, to + 1) === typed && balanced(state.doc.lineAt(to).text)) {
    view.dispatch({ selection: { anchor: to + 1 } }); // it is there already, whoever put it in
    return true;
  }
  if (!call) return false;
  if (typed === " ") return from === there;
  if (typed === "(" && from === call.open + 1 && call.blank[0]?.from === from && call.blank[0].to === to && call.blank.length === call.commas.length + 1) {
    view.dispatch({ changes: { from: call.open, to: call.close + 1 } }); // who goes on with a bracket, as without the fields
    const bracket = insertBracket(view.state, "(");
    if (bracket) view.dispatch(bracket);
    return !!bracket;
  }
  if (!within(state, call, from)) return false;
  if (typed === "," && call.commas.includes(to)) {
    if (from < to) view.dispatch({ changes: { from, to } });
    leap(view);
    if (view.state.sliceDoc(view.state.selection.main.from - 1, view.state.selection.main.from) === " ") spaced = view.state.selection.main.from;
    return true;
  }
  const blank = call.commas.filter((one) => one >= to).every((one) => call.blank.some((two) => two.from > one && !/\S/.test(state.sliceDoc(one + 1, two.from))));
  if (typed === ")" && blank && (to === call.close || call.commas.includes(to))) {
    view.dispatch({ changes: { from, to: call.close }, selection: { anchor: from + 1 }, userEvent: "input.type" }); // arguments that nobody wants go
    return true;
  }
  return false;
});

export const callFields: Extension = [calls, Prec.highest(typing)];
