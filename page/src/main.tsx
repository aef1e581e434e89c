// The page: its parts, and how it begins.
import "./page.css";
import { effect } from "@preact/signals";
import { render } from "preact";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { editor, mends, mountEditor, replaceText, takeUp } from "./editor/editor";
import { downloadText, overwrite, takeFromDisk, watchDisk } from "./files";
import { useFocusBack } from "./focus";
import { KEYS, listen } from "./keys";
import { Code, Explain, ticked } from "./panels/Explain";
import { Grid } from "./panels/Grid";
import { MotionPanel } from "./panels/Motion";
import { Reader } from "./panels/Reader";
import { RequestPanel } from "./panels/Request";
import { Stage } from "./panels/Stage";
import { Timeline } from "./panels/Timeline";
import { copy, TopBar } from "./panels/TopBar";
import { Where } from "./panels/Where";
import { Offers, Tour, Welcome, welcome } from "./panels/Welcome";
import { Why } from "./panels/Why";
import { path, rest, seek, taken, timed } from "./motions";
import { decode, encode, link, state, takeOver } from "./share";
import { remember } from "./rare";
import { reading } from "./reader";
import { connected, token } from "./server";
import { alone, boot, conflict, edited, help, label, layout, meshes, offered, on, pane, poses, preview, problems, request, restored, result, saved, selected, spec, tab } from "./state";
import { check, explain, select, show } from "./store";
import type { Problem, Request } from "./types";

const KEPT = `scenegen.state.${token}`;
const linked = location.hash.startsWith("#s=") && !alone; // the page begins with the state of a link

function Editor() {
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => {
    mountEditor(root.current!, linked);
    void check();
  }, []);
  return (
    <section class="editor" aria-label="spec">
      <Lost />
      {restored.value ? <p class="restored" role="status">What you wrote and did not save is here again. <button class="chip" onClick={() => { replaceText(saved.value.text ?? ""); editor.focus(); }}>Discard</button></p> : null}
      {offered.value ? <p class="restored" role="status">You wrote in this before and did not save it. <button class="chip" onClick={takeUp}>Go on with that</button></p> : null}
      <Conflict />
      <div class="code" ref={root} />
      <Reader />
      <Problems />
    </section>
  );
}

const GONE = {
  lost: "The server is gone, nothing is saved. Start `scenegen view` again where it was started: this page goes on then.",
  other: "Another server is here now, and nothing is saved. Open the link that `scenegen view` printed last.",
};

/** Without a server, the text can still be taken out. */
function Lost() {
  const how = connected.value;
  if (alone || (how !== "lost" && how !== "other")) return null;
  return (
    <p class="restored conflict lost" role="alert">
      <span>{ticked(GONE[how])}</span>
      <button class="chip" onClick={() => void copy(editor.state.doc.toString(), "the text").then(() => editor.focus())}>Copy my text</button>
      <button class="chip" onClick={() => { downloadText(); editor.focus(); }}>Download my text</button>
    </p>
  );
}

function Conflict() {
  const one = conflict.value;
  if (!one) return null;
  const start = { line: 0, character: 0 };
  return (
    <p class="restored conflict" role="alert">
      <span>{one.path} on the disk is another text than this one began with.</span>
      <button class="chip" onClick={() => (reading.value = { name: one.path, path: one.path, text: one.text, from: start, to: start })}>Look at it</button>
      <button class="chip" onClick={() => { takeFromDisk(one); editor.focus(); }}>Load it</button>
      <button class="chip" onClick={() => { void overwrite(one); editor.focus(); }}>Save mine over it</button>
    </p>
  );
}

function Problems() {
  const all = problems.value;
  if (!all.length) return null;
  const go = (one: Problem) => () => {
    const line = editor.state.doc.line(Math.min(one.range.start.line + 1, editor.state.doc.lines));
    editor.dispatch({ selection: { anchor: Math.min(line.from + one.range.start.character, line.to) }, scrollIntoView: true });
    editor.focus();
  };
  return (
    <ul class="problems" aria-label="problems" tabIndex={0}>
      {all.slice(0, 50).map((one, k) => {
        const [title, ...rest] = one.message.split("\n");
        return (
          <li key={k} class={one.severity === 1 ? "error" : "warning"}>
            <button class="go" onClick={go(one)}><span class="where">{one.range.start.line + 1}:{one.range.start.character + 1}</span><b>{ticked(title)}</b>{rest.map((line, j) => <span key={j} class={line.startsWith("help:") ? "help" : ""}>{ticked(line)}</span>)}</button>
            <span class="ways">{one.code ? <Code code={one.code} /> : null}{mends(one).map(({ name, apply }) => <button key={name} class="diagnostic-code mend" onClick={() => apply(editor)}>{name}</button>)}</span>
          </li>
        );
      })}
    </ul>
  );
}

const TABS = [["request", alone ? "Filter" : "Request"], ["why", "Why"], ["where", "Where"], ["motion", "Motion"]] as const;

function Panel() {
  const open = tab.value === "motion" && timed.value ? "request" : tab.value; // a motion has its own line of time
  const tabs = TABS.filter(([key]) => !((alone || timed.value) && key === "motion"));
  const walk = (event: KeyboardEvent) => {
    const at = tabs.findIndex(([key]) => key === open), { length } = tabs;
    const to = { ArrowRight: (at + 1) % length, ArrowLeft: (at - 1 + length) % length, Home: 0, End: length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    tab.value = tabs[to][0];
    document.getElementById(`tab-${tabs[to][0]}`)?.focus();
  };
  return (
    <aside class="panel" aria-label="details">
      <div class="tabs" role="tablist" aria-label="details" onKeyDown={walk}>
        {tabs.map(([key, name]) => <button key={key} role="tab" id={`tab-${key}`} tabIndex={open === key ? 0 : -1} aria-controls="details" aria-selected={open === key} onClick={() => (tab.value = key)}>{name}</button>)}
      </div>
      <div class="inside" id="details" role="tabpanel" aria-labelledby={`tab-${open}`} tabIndex={0}>
        {open === "request" ? <RequestPanel /> : open === "why" ? <Why /> : open === "where" ? <Where /> : <MotionPanel />}
      </div>
    </aside>
  );
}

function Help() {
  const close = useRef<HTMLButtonElement>(null);
  useFocusBack();
  useLayoutEffect(() => close.current?.focus(), []); // before the page below is out of reach, which takes the focus from it
  return (
    <div class="veil" onClick={() => (help.value = false)}>
      <div class="help-box" role="dialog" aria-modal="true" aria-label="keys" onClick={(event) => event.stopPropagation()}>
        <header role="presentation"><h2>Keys</h2><button ref={close} onClick={() => (help.value = false)}>close <kbd>Esc</kbd></button></header>
        <dl>{KEYS.map(([key, what]) => <div key={key}><dt>{key.split(/(?<=\S), /).map((way, w) => [w ? <span key={`or ${w}`}>or</span> : null, ...way.split(/(?<=\S) (?=\S)/).map((one, k) => <kbd key={`${w} ${k}`}>{one}</kbd>)])}</dt><dd>{what}</dd></div>)}</dl>
        <p>Drag an object to move it, its green knob (or Shift) to turn it. Double-click keeps it in place in new scenes. phi is the margin by which a scene satisfies the formula, in metres and radians: the formula is satisfied where phi is at least 0.</p>
        {alone ? null : <Offers />}
      </div>
    </div>
  );
}

function Page() {
  return (
    <div class={`page pane-${pane.value} ${layout.value}${alone ? " alone" : ""}`}>
      <TopBar />
      <main inert={help.value}>
        <Editor />
        <section class={`middle${timed.value ? " timed" : ""}`} aria-label={timed.value ? "motions" : "scenes"}>
          <Stage />
          <Timeline />
          <Grid />
        </section>
        <Panel />
      </main>
      <nav class="panes" inert={help.value} aria-label="parts of the page">
        {([["spec", "Spec"], ["scenes", timed.value ? "Motions" : "Scenes"], ["panel", alone ? "Filter" : "Request"]] as const).map(([key, name]) => <button key={key} aria-pressed={pane.value === key} onClick={() => (pane.value = key)}>{name}{key === "spec" && problems.value.length ? <i class="badge">{problems.value.length}</i> : null}</button>)}
      </nav>
      <Explain />
      {help.value ? <Help /> : null}
      {welcome.value ? <Welcome /> : null}
      <Tour />
    </div>
  );
}

function begin(): void {
  let comeBack = null;
  const hash = location.hash;
  try {
    if (linked) {
      history.replaceState(null, "", location.pathname + location.search); // a reload keeps what is written from here on
      comeBack = takeOver(decode(hash.slice(3)), true);
    } else if (!alone) {
      const kept = sessionStorage.getItem(KEPT);
      if (kept) comeBack = takeOver(decode(kept), false);
    }
  } catch {
    /* a link that was cut short: the page begins as it would without */
  }
  if (alone) {
    spec.value = alone.spec;
    meshes.value = alone.meshes;
    remember(alone.rarity);
    label.value = alone.spec.labels[0].name;
    request.value = { ...request.value, phi: Object.fromEntries(alone.spec.labels.map((one) => [one.name, [null, null]])) };
  } else if (boot.scenes && !comeBack && !linked && !sessionStorage.getItem(KEPT)) {
    const { phi, n, spread, counts } = boot.request as Request;
    request.value = { ...request.value, phi: phi ?? {}, n: Math.min(n ?? 16, 400), spread: spread ?? "flat", counts };
  }
  welcome.value = !!boot.welcome && !comeBack && !linked && !boot.draft?.text;
  (window as any).scenegen.link = link; // for tests, as what store.ts puts there
  render(<Page />, document.getElementById("app")!);
  listen();
  if (!alone) watchDisk();
  if (boot.scenes && alone) show(taken(boot.scenes), false);
  const scene = selected.value; // of the link, or before a reload; a first look may have fewer
  if (!alone && (comeBack || scene)) {
    const wanted = comeBack;
    const fits = () => !wanted || (wanted.moments ? path.value.length === wanted.moments.length : poses.value.length === wanted.poses.length);
    const stop = effect(() => {
      if (result.value && !preview.value && fits())
        queueMicrotask(() => {
          stop();
          select(scene);
          if (!wanted) return;
          if (wanted.moments) {
            path.value = wanted.moments;
            rest();
            seek(wanted.frame ?? 0);
          } else poses.value = wanted.poses;
          on.value = wanted.on ?? on.value;
          edited.value = true;
          explain();
        });
    });
  }
  if (alone) select(0, true);
  addEventListener("hashchange", () => location.hash.startsWith("#s=") && location.reload()); // another link in this tab
  addEventListener("pagehide", () => {
    try {
      if (!alone) sessionStorage.setItem(KEPT, encode({ ...state(), text: undefined }));
    } catch {
      /* no room */
    }
  });
}

begin();
