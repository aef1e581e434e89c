// The large scene: in three dimensions or from above, with what it is worth.
import { effect, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Tag } from "../scene/apart";
import { Table3d } from "../scene/table3d";
import { marks, seconds, timed, trails } from "../motions";
import { EDGES } from "../scene/top2d";
import { hold, moved, place, putOn } from "../hands";
import { alone, bases, busy, changed, chooser, clash, decides, edited, finding, heat, label, lit, meshes, message, movable, names, on, outdated, poses, preview, problems, refusal, report, request, result, scenes, selected, shown, spec, stale, thing, view, wrong } from "../state";
import { giveUp, keepFound, putBack, sample, step, undo } from "../store";
import { grade, inWords } from "../said";
import { Code, ticked } from "./Explain";
import { mentions } from "./Named";
import { degrees, signed } from "../words";
import { TopView } from "./TopView";

export let table: Table3d | null = null;

export function Stage() {
  return (
    <section class={`stage${stale.value ? " stale" : wrong.value || (outdated.value && scenes.value) ? " behind" : ""}`} aria-label="scene">
      {view.value === "3d" ? <Three /> : <div class="flat"><TopView /></div>}
      <div class="over"><Phi /><AboutPhi /><InWords /><Chosen /></div>
      <Tools />
      <Notes />
      <Trouble />
      {!spec.value && problems.value.length ? <p class="hint">Correct the spec to see its scenes.</p> : null}
    </section>
  );
}

function Three() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [tags, setTags] = useState<Tag[]>([]);
  const [broken, setBroken] = useState(false);
  useEffect(() => {
    const node = canvas.current!;
    let made: Table3d;
    try {
      made = new Table3d(node, {
        pick: (name) => (thing.value = name),
        move: (name, x, y) => place(name, { x, y }),
        turn: (name, theta) => place(name, { theta }),
        end: () => void moved(),
        light: (name) => (lit.value = name),
        free: (name) => movable.value && !spec.value?.objects.find((one) => one.name === name)?.fixed,
      });
    } catch {
      setBroken(true); // no WebGL: the top view shows the same
      view.value = "top";
      return;
    }
    table = made;
    (window as any).table = made;
    made.onTags = setTags;
    const size = new ResizeObserver(() => made.resize(node.clientWidth, node.clientHeight));
    size.observe(node);
    made.resize(node.clientWidth, node.clientHeight);
    const ends = [
      effect(() => {
        if (spec.value) made.setSpec(spec.value, meshes.value);
        made.setPoses(poses.peek(), bases.peek());
      }),
      effect(() => made.setPoses(poses.value, bases.value)),
      effect(() => made.choose(thing.value)),
      effect(() => made.light(lit.value)),
      effect(() => made.wait(busy.value !== "")),
      effect(() => {
        made.names = names.value;
        made.wake();
      }),
      effect(() => made.setTrails(timed.value ? trails.value.map(({ index, points }) => ({ points, color: EDGES[index % EDGES.length] })) : [])),
      effect(() => made.setMarks(marks.value, 0.006 * made.side + level())),
    ];
    return () => {
      for (const end of ends) end();
      size.disconnect();
      made.stop();
      table = null;
    };
  }, []);
  if (broken) return null;
  return (
    <div class="three">
      <canvas ref={canvas} tabIndex={0} role="application" aria-label="scene in 3D: arrow keys move the selected object, comma and period turn it, Tab leaves" onDblClick={() => thing.value && hold(thing.value)} />
      <div class="tags" aria-hidden="true">
        <svg>{tags.map(({ line, kind }, k) => line && <g key={k} class={kind}><line x1={line[0]} y1={line[1]} x2={line[2]} y2={line[3]} /><circle cx={line[0]} cy={line[1]} r={2.4} /></g>)}</svg>
        {tags.map((tag, k) => <span key={k} class={tag.kind} style={{ transform: `translate(-50%,-50%) translate(${tag.x.toFixed(1)}px,${tag.y.toFixed(1)}px)` }}>{tag.text}</span>)}
      </div>
    </div>
  );
}

/** How high above the table the highest object stands of those that set phi: what is measured is drawn there. */
function level(): number {
  const one = decides.value, all = spec.peek()?.objects ?? [];
  const about = all.map(({ name }) => !!one && mentions(one.text, name));
  return Math.max(0, ...bases.peek().filter((_, k) => about[k] || !about.includes(true)));
}

function Phi() {
  const now = spec.value;
  const found = report.value;
  if (!now || !found || stale.value) return null;
  const unknown = alone && edited.value; // moved, and nothing here scores it
  const all: [string, number][] = unknown ? now.labels.map(({ name }) => [name, NaN]) : Object.entries(found.phi).map(([name, values]) => [name, values[0]]);
  if (found.require && found.require[0] < 0) all.push(["require", found.require[0]]);
  return (
    <div class="phis" role="group" aria-label={`phi of the ${now.time ? "motion" : "scene"}`}>
      {all.map(([name, phi]) => (
        <button key={name} class={`phi ${unknown ? "" : phi >= 0 ? "good" : "bad"}${label.value === name ? " chosen" : ""}`} data-label={name} data-phi={String(phi)} title={`phi of ${name}${unknown ? `: ${UNKNOWN}` : ` = ${phi}`}`} onClick={() => (label.value = name)}>
          <span class="cut">{name}</span> <b>{unknown ? "?" : signed(phi)}</b>
        </button>
      ))}
      <button class="phi ask" aria-expanded={asking.value} aria-label="what phi is" title="what phi is" onClick={() => (asking.value = !asking.value)}>?</button>
      {edited.value ? <span class="phi moved">{now.time ? "changed" : "moved"} by hand{unknown ? `; ${UNKNOWN}` : ""}</span> : null}
    </div>
  );
}

/** What sets phi, in words: the distance that is measured, and how well the label is satisfied. */
function InWords() {
  const one = decides.value, found = report.value;
  if (!one || !found || stale.value || outdated.value || wrong.value || (alone && edited.value)) return null;
  const { words, code } = inWords(one);
  const phi = one.required ? one.value : found.phi[label.value]?.[0];
  const how = one.required ? (one.value >= 0 ? "as required" : "against what is required") : grade(phi, label.value);
  const when = one.moment === undefined ? "" : `at ${seconds(one.moment)}: `;
  return <p class={`in-words ${phi >= 0 ? "good" : "bad"}`} title={`${when}${code} ${words}: ${how}`}><span>{when}{code ? <><code>{code}</code> </> : null}{words}:</span> <b>{how}</b></p>;
}

const UNKNOWN = "this page has no server that computes phi";

export const asking = signal(false); // somebody wants to know what phi is

function AboutPhi() {
  if (!asking.value) return null;
  return (
    <p class="about" role="note">
      <b>phi</b> says by how much a scene satisfies a formula, in metres or radians: at 0 or more the formula is satisfied, below 0 it is not. Choose a range of phi to get scenes that barely satisfy it, clearly satisfy it, or just fail to.
      <button class="chip" onClick={() => { asking.value = false; document.querySelector<HTMLElement>(".phi.ask")?.focus(); }}>close</button>
    </p>
  );
}

function Tools() {
  const all = shown.value;
  return (
    <div class="tools">
      <div class="segment" role="group" aria-label="view">
        <button aria-pressed={view.value === "3d"} onClick={() => (view.value = "3d")} title="in 3D (v)">3D</button>
        <button aria-pressed={view.value === "top"} onClick={() => (view.value = "top")} title="from above (v)">Top</button>
      </div>
      <button class="tool" aria-pressed={names.value} onClick={() => (names.value = !names.value)} title="names of objects (l)">Names</button>
      {view.value === "top" ? <button class="tool" aria-pressed={heat.value} onClick={() => (heat.value = !heat.value)} title="where objects go in all scenes (m)">Heat</button> : <button class="tool" onClick={() => table?.reset()} title="the view from the start (0)">Reset</button>}
      <span class="pager">
        <button class="tool" onClick={() => step(-1)} aria-label="previous scene" title="previous scene ([)" disabled={scenes.value < 2}>‹</button>
        <span>{all.length ? `${all.indexOf(selected.value) + 1} / ${all.length}` : "–"}</span>
        <button class="tool" onClick={() => step(1)} aria-label="next scene" title="next scene (])" disabled={scenes.value < 2}>›</button>
      </span>
    </div>
  );
}

function Chosen() {
  const now = spec.value;
  const index = now?.objects.findIndex((one) => one.name === thing.value) ?? -1;
  if (!now || index < 0 || !poses.value[index]) return null;
  const one = now.objects[index];
  const [x, y, theta] = poses.value[index];
  const kept = one.name in request.value.fix;
  return (
    <div class="chosen-thing">
      <b>{one.name}</b>
      <span class="pose">{x.toFixed(3)}, {y.toFixed(3)} m · {degrees(theta)}</span>
      <Standing name={one.name} surfaces={one.surfaces} column={chooser(now, one.name)} />
      {one.fixed ? <span class="quiet">fixed by the spec</span> : alone ? null : (
        <>
          <button class="tool" aria-pressed={kept} onClick={() => hold(one.name)} title={timed.value ? "in new motions it stands here all the time (h)" : "new scenes have it here (h)"}>Keep in place</button>
          {kept ? <button class="tool" onClick={() => void sample()} title="sample the other objects (Enter)">Sample the others</button> : null}
        </>
      )}
      {edited.value ? <><button class="tool" onClick={undo} title="take the last move back (Ctrl+Z)">Undo</button><button class="tool" onClick={putBack} title="as it was sampled (z)">Put back</button></> : null}
    </div>
  );
}

/** What the chosen object stands on. Where that is one of several surfaces, moving it keeps it there, and it can be put
 * onto another one. */
function Standing({ name, surfaces, column }: { name: string; surfaces: string[]; column: number }) {
  const mine = on.value?.[column];
  if (!surfaces.length || (column >= 0 && mine === undefined)) return null;
  if (column < 0 || alone) return <span class="quiet">on {surfaces[column < 0 ? 0 : mine! - 1]}</span>;
  return (
    <label class="standing" title="the surface that it stands on, also while you move it (u: the next surface)">
      on <select value={mine} onChange={(event) => putOn(name, Number(event.currentTarget.value))}>{surfaces.map((one, k) => <option key={one} value={k + 1}>{one}</option>)}</select>
    </label>
  );
}

/** Of which text or request the scenes are that are still in sight. */
function older(): string {
  if (wrong.value) return "the spec has a mistake; these scenes are of the text before it";
  if (finding.value) return "no motion in the range was found; these are the nearest ones";
  return `these scenes are of the ${changed.value} before the last change`;
}

/** What is worth knowing of the scenes, such as that there are fewer than wanted; of older ones, that they are older. */
function Notes() {
  if (!spec.value || !scenes.value || preview.value) return null;
  if (wrong.value) return <div class="notes"><p class="behind-note">{older()}</p></div>;
  if (busy.value === "sample") return null;
  if (outdated.value) return refusal.value || busy.value ? null : <div class="notes"><p class="behind-note">{older()}</p></div>;
  return (
    <ul class="notes warnings" aria-label="warnings">
      {(result.value?.warnings ?? []).map(({ code, title }) => <li key={code + title}>{ticked(title)} {code ? <Code code={code} /> : null}</li>)}
    </ul>
  );
}

const BEAT = 200; // ms: an animation of the style sheet would have the whole page drawn 60 times a second

/** A bar that runs while scenes are sampled; not for what takes a moment only. */
function Working() {
  const bar = useRef<HTMLDivElement>(null);
  useEffect(() => {
    let beat = -1;
    const timer = setInterval(() => {
      beat++;
      if (bar.current) bar.current.style.transform = `translateX(${-100 + (beat % 7) * 72}%)`;
    }, BEAT);
    return () => clearInterval(timer);
  }, []);
  return <div class="working" role="progressbar" aria-label="sampling"><div ref={bar} /></div>;
}

const LONG = 3; // seconds after which a search without scenes says that it goes on

/** How long nothing has been found. */
function Searching() {
  const [past, setPast] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => setPast((before) => before + 1), 1000);
    return () => clearInterval(timer);
  }, []);
  const now = spec.value;
  if (past < LONG) return null;
  if (!now) return <div class="searching" role="status"><b>The spec is being read</b><p>{past} s so far. A large one takes long.</p></div>;
  return (
    <div class="searching" role="status">
      <b>No {now.time ? "motion" : "scene"} in the range yet</b>
      <p>{now.objects.length} objects, {past} s so far. {now.objects.length > MANY ? "So many objects take long where none may overlap: fewer of them, or a larger workspace, is faster." : "A wider range of phi is faster."}</p>
      <button class="chip" onClick={giveUpHere}>Stop</button>
    </div>
  );
}

const MANY = 60; // objects

function giveUpHere(): void {
  giveUp();
  refusal.value = clash.value?.refusal ?? null;
  message.value = refusal.value?.title ?? "stopped";
}

function Trouble() {
  const found = scenes.value;
  const working = busy.value === "sample";
  const clashes = clash.value?.refusal;
  const told = working ? clashes : refusal.value;
  const some = finding.value;
  return (
    <>
      {working ? <Working /> : null}
      {(working || (busy.value && !spec.value)) && !found && !told ? <Searching key={spec.value?.sha256 ?? ""} /> : null}
      {preview.value && working ? <div class="first">{some ? <Finding {...some} /> : found ? "a first look; the wanted scenes are being sampled" : "sampling scenes in the new range"}</div> : null}
      {told && !(working && found) ? (
        <div class="trouble" role="alert">
          <b>{ticked(told.title)}</b>{told.code ? <Code code={told.code} /> : null}
          {told.label ? <p>{ticked(told.label)}</p> : null}
          {told.note ? <pre>{ticked(told.note)}</pre> : null}
          {told.help ? <p class="help">{ticked(told.help)}</p> : null}
          {working ? <p>Sampling still looks for such scenes, in case there are some. <button class="chip" onClick={giveUpHere}>Stop</button></p> : <button class="chip" onClick={() => (refusal.value = null)}>close</button>}
          {!working && found && outdated.value ? <p class="quiet">Behind this: {older()}.</p> : null}
        </div>
      ) : null}
    </>
  );
}

/** How far the search for motions is, why it goes on, and its end by hand. */
function Finding({ hits, left }: { hits: number; left: number }) {
  const most = `at most ${Math.ceil(left)} s more`;
  const what = !hits ? "no motion in the range yet; these are the nearest ones" : hits < request.value.n ? `${hits} of ${request.value.n} motions found` : `${hits} motions found; they still resemble each other, and are moved on until they are a fair sample`;
  return <>{what}; {most} <button class="chip" onClick={hits ? keepFound : giveUpHere}>{hits ? "Stop, keep these" : "Stop"}</button></>;
}
