// What scenes are wanted.
import { signal } from "@preact/signals";
import { alone, boot, methodsFor, request, result, spec } from "../state";
import { change, next, sample, setCount } from "../store";
import { Handles } from "./Handles";

const more = signal(false); // method, seed and spread are in sight

export function RequestPanel() {
  const now = spec.value;
  if (!now) return <p class="empty">Correct the spec to ask for {boot.scenes?.motions ? "motions" : "scenes"}.</p>;
  const wanted = request.value;
  const methods = methodsFor(now);
  const most = Math.max(1, now.most);
  const count = <input type="number" min={1} max={most} value={wanted.n} onChange={(event) => change({ n: clamp(event, 1, most) })} />;
  const two = Object.values(wanted.phi).some(([low, high]) => low !== null && high !== null);
  const held = Object.keys(wanted.fix);
  return (
    <div class="request">
      {alone ? <p class="note">This page holds {result.value?.poses.length} {now.time ? "motions" : "scenes"} and has no server. The handles choose among {now.time ? "them" : "the scenes; objects can be moved"}, and <i>Download</i> saves what is shown. New {now.time ? "motions, moving objects" : "scenes, phi of a moved scene"} and changes of the text need <code>scenegen view</code>.</p> : null}
      {now.labels.map((one) => <Handles key={one.name} name={one.name} />)}
      {alone && !now.numbers?.length ? null : (
        <div class="fields">
          {(now.numbers ?? []).map((one) => (
            <label key={one.name}>
              {one.assets.length ? `${one.name}: which` : `number of ${one.name}`}
              <select data-count={one.name} value={one.now} disabled={!!alone} title="the spec draws this for each scene; the page shows scenes with one choice" onChange={(event) => setCount(one.name, Number(event.currentTarget.value))}>
                {Array.from({ length: one.most - one.least + 1 }, (_, k) => one.least + k).map((k) => <option key={k} value={k}>{one.assets[k - 1] ?? k}</option>)}
              </select>
            </label>
          ))}
          {alone ? null : <>{now.time ? <label>motions {count}</label> : <label>scenes {count}</label>}
          <div class="joined"><button onClick={next} title={`new ${now.time ? "motions" : "scenes"}: use the next seed (n)`}>New {now.time ? "motions" : "scenes"} ↻</button></div></>}
        </div>
      )}
      {alone ? null : (
        <details class="further" open={more.value} onToggle={(event) => (more.value = event.currentTarget.open)}>
          <summary>More: <b>seed {wanted.seed}, {wanted.method}, {wanted.spread === "flat" ? "evenly" : "like random scenes"}</b></summary>
          <div class="fields">
            <label>seed <input type="number" min={0} value={wanted.seed} onChange={(event) => change({ seed: clamp(event, 0, 2 ** 53) })} /></label>
            <label>method <select value={wanted.method} onChange={(event) => change({ method: event.currentTarget.value })}>{methods.map((one) => <option key={one}>{one}</option>)}</select></label>
            <label>spread <select value={wanted.spread} onChange={(event) => change({ spread: event.currentTarget.value })}><option value="flat">evenly over phi</option><option value="base">like random scenes</option></select></label>
            {wanted.spread === "flat" && wanted.method !== "model" && !two ? <p class="caption">“Evenly over phi” needs a range with two ends. With an open end, {now.time ? "motions" : "scenes"} are spread like random ones in the range.</p> : null}
          </div>
        </details>
      )}
      {held.length ? (
        <div class="held">
          <span>kept in place:</span>
          {held.map((name) => <button key={name} class="chip" onClick={() => { const fix = { ...wanted.fix }; delete fix[name]; change({ fix }); }} title="let it move again">{name} ×</button>)}
          <button class="chip strong" onClick={() => void sample()}>sample the others</button>
        </div>
      ) : null}
    </div>
  );
}

function clamp(event: Event, low: number, high: number): number {
  const value = Math.round(Number((event.currentTarget as HTMLInputElement).value));
  return Math.min(Math.max(Number.isFinite(value) ? value : low, low), high);
}
