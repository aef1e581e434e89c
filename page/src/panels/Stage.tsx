// The large scene: in three dimensions or from above, with what it is worth.
import { effect, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { Table3d, type Tag } from "../scene/table3d";
import { marks, timed, trails } from "../motions";
import { EDGES } from "../scene/top2d";
import { hold, moved, place, putOn } from "../hands";
import { alone, bases, busy, chooser, clash, edited, finding, heat, label, meshes, movable, names, on, outdated, poses, preview, problems, refusal, report, request, result, scenes, selected, shown, spec, stale, thing, view, wrong } from "../state";
import { giveUp, putBack, sample, step, undo } from "../store";
import { Code, ticked } from "./Explain";
import { degrees, signed } from "../words";
import { TopView } from "./TopView";

export let table: Table3d | null = null;

export function Stage() {
  return (
    <section class={`stage${stale.value ? " stale" : wrong.value || (outdated.value && scenes.value) ? " behind" : ""}`} aria-label="scene">
      {view.value === "3d" ? <Three /> : <div class="flat"><TopView /></div>}
      <div class="over"><Phi /><AboutPhi /><Chosen /></div>
      <Tools />
      <Warnings />
      <Trouble />
      {spec.value && wrong.value && scenes.value ? <div class="first behind-note">the spec has a mistake; these scenes are of the text before it</div> : null}
      {!wrong.value && outdated.value && refusal.value && scenes.value ? <div class="first behind-note">{finding.value ? "no motion in the range was found; these are the nearest ones" : "these scenes are of the request before the last change"}</div> : null}
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
      effect(() => made.wait(busy.value !== "")),
      effect(() => {
        made.names = names.value;
        made.wake();
      }),
      effect(() => made.setTrails(timed.value ? trails.value.map(({ index, points }) => ({ points, color: EDGES[index % EDGES.length] })) : [])),
      effect(() => made.setMarks(marks.value, 0.006 * made.side + Math.max(0, ...bases.peek()))),
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
        {tags.map((tag, k) => <span key={k} class={tag.kind} style={{ transform: `translate(-50%,-50%) translate(${tag.x.toFixed(1)}px,${tag.y.toFixed(1)}px)` }}>{tag.text}</span>)}
      </div>
    </div>
  );
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
        <button key={name} class={`phi ${unknown ? "" : phi >= 0 ? "good" : "bad"}${label.value === name ? " chosen" : ""}`} data-label={name} data-phi={String(phi)} title={unknown ? UNKNOWN : `phi of ${name} = ${phi}`} onClick={() => (label.value = name)}>
          <span>{name}</span> <b>{unknown ? "?" : signed(phi)}</b>
        </button>
      ))}
      <button class="phi ask" aria-expanded={asking.value} aria-label="what phi is" title="what phi is" onClick={() => (asking.value = !asking.value)}>?</button>
      {edited.value ? <span class="phi moved">{now.time ? "changed" : "moved"} by hand{unknown ? `; ${UNKNOWN}` : ""}</span> : null}
    </div>
  );
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

/** What is worth knowing of the scenes, such as that there are fewer than wanted. */
function Warnings() {
  const found = result.value?.warnings ?? [];
  if (!found.length || wrong.value || preview.value || busy.value === "sample") return null;
  return (
    <ul class="warnings" aria-label="warnings">
      {found.map(({ code, title }) => <li key={code + title}>{ticked(title)} <Code code={code} /></li>)}
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

function giveUpHere(): void {
  giveUp();
  refusal.value = clash.value?.refusal ?? null;
}

function Trouble() {
  const found = scenes.value;
  const working = busy.value === "sample";
  const clashes = clash.value?.refusal;
  const told = working ? clashes : refusal.value && (clashes ?? refusal.value); // one cause is told once, in the same words
  const some = finding.value;
  const coming = some && `${some.hits ? `${some.hits} of ${request.value.n} motions found` : "no motion in the range yet; these are the nearest ones"}; at most ${Math.ceil(some.left)} s more`;
  return (
    <>
      {working ? <Working /> : null}
      {preview.value && working ? <div class="first">{coming ?? (found ? "a first look; the wanted scenes are being sampled" : "sampling scenes in the new range")}</div> : null}
      {told && !(working && found) ? (
        <div class="trouble" role="alert">
          <b>{ticked(told.title)}</b>{told.code ? <Code code={told.code} /> : null}
          {told.label ? <p>{ticked(told.label)}</p> : null}
          {told.note ? <pre>{ticked(told.note)}</pre> : null}
          {told.help ? <p class="help">{ticked(told.help)}</p> : null}
          {working ? <p>Sampling still looks for such scenes, in case there are some. <button class="chip" onClick={giveUpHere}>Stop</button></p> : <button class="chip" onClick={() => (refusal.value = null)}>close</button>}
        </div>
      ) : null}
    </>
  );
}
