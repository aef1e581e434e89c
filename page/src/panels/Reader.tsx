// A file beside the spec, in which something is defined: it is read, not written.
import { EditorView } from "@codemirror/view";
import { useEffect, useRef } from "preact/hooks";
import { editor, readOnlyState } from "../editor/editor";
import { openFile } from "../files";
import { reading } from "../reader";
import { unsaved } from "../state";

export function closeReader(): void {
  reading.value = null;
  editor.focus();
}

export function Reader() {
  const one = reading.value;
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!one) return;
    const state = readOnlyState(one.text, `${one.name}, to read`);
    const at = (place: { line: number; character: number }) => {
      const line = state.doc.line(Math.min(place.line + 1, state.doc.lines));
      return Math.min(line.from + place.character, line.to);
    };
    const view = new EditorView({ state, parent: root.current! });
    view.dispatch({ selection: { anchor: at(one.from), head: at(one.to) }, effects: EditorView.scrollIntoView(at(one.from), { y: "center" }) });
    view.focus();
    return () => view.destroy();
  }, [one]);
  if (!one) return null;
  return (
    <div class="reader" role="dialog" aria-label={`${one.name}, to read`}>
      <header role="presentation">
        <b>{one.path ?? one.name}</b> <span class="quiet">{one.path === null ? "built in" : "read only"}</span>
        {one.path === null ? null : <button class="tool" disabled={unsaved.value} title={unsaved.value ? "save the spec first" : "open it in the editor"} onClick={() => { const path = one.path!; closeReader(); void openFile(path); }}>Open</button>}
        <button class="tool" onClick={closeReader}>Back <kbd>Esc</kbd></button>
      </header>
      <div class="code" ref={root} />
    </div>
  );
}
