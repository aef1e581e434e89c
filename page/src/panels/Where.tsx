// Over all scenes: how phi is spread, and where each object goes.
import { useEffect, useRef } from "preact/hooks";
import { moments } from "../motions";
import { outline } from "../scene/top2d";
import { lit, result, shown, spec, thing } from "../state";
import { select } from "../store";
import { theme } from "../theme";
import type { Result, Spec } from "../types";
import { number } from "../words";

const BINS = 12; // wide enough to be hit

export function Where() {
  const now = spec.value;
  const found = result.value;
  if (!now || !found) return <p class="empty">Nothing yet.</p>;
  return (
    <div class="where">
      {now.labels.map((one) => <Histogram key={one.name} name={one.name} values={shown.value.map((k) => found.phi[one.name][k])} scenes={shown.value} />)}
      <h2>Where objects {now.time ? "are, at all moments" : "go"}</h2>
      <div class="heats">{now.objects.slice(0, 24).map((one, k) => <Heat key={one.name} index={k} name={one.name} />)}</div>
    </div>
  );
}

function Histogram({ name, values, scenes }: { name: string; values: number[]; scenes: number[] }) {
  if (!values.length) return null;
  const low = Math.min(...values), high = Math.max(...values);
  const width = Math.max(high - low, 1e-9);
  const bins: number[][] = Array.from({ length: BINS }, () => []);
  values.forEach((phi, k) => bins[Math.min(BINS - 1, Math.floor((BINS * (phi - low)) / width))].push(scenes[k]));
  const most = Math.max(...bins.map((one) => one.length));
  return (
    <figure class="histogram">
      <figcaption><b class="cut" title={name}>{name}</b> phi {number(low)} to {number(high)}, mean {number(values.reduce((a, b) => a + b, 0) / values.length)}</figcaption>
      <div class="bars">
        {bins.map((one, k) => {
          const middle = low + ((k + 0.5) * width) / BINS;
          const words = `${one.length} with phi near ${number(middle)}`;
          return <button key={k} class={middle >= 0 ? "good" : "bad"} style={{ height: `${one.length ? 4 + (44 * one.length) / most : 1}px` }} title={words} aria-label={words} disabled={!one.length} onClick={() => select(one[0])} />;
        })}
      </div>
    </figure>
  );
}

const CELLS = 56; // along the longer side of the workspace
const BLUR = 1.8; // cells: the width of what one object leaves

/** How often an object stands where: (rows, columns) of cells over the workspace, of 1 at most. */
function density(found: Result, scenes: number[], index: number, { x, y }: Spec["workspace"], columns: number, rows: number): Float32Array {
  let counts = new Float32Array(columns * rows);
  for (const k of scenes)
    for (const poses of found.poses[k] ? moments(found, k) : []) {
      const pose = poses[index];
      if (!pose) continue;
      const i = Math.min(Math.floor((columns * (pose[0] - x[0])) / (x[1] - x[0])), columns - 1), j = Math.min(Math.floor((rows * (pose[1] - y[0])) / (y[1] - y[0])), rows - 1);
      if (i >= 0 && j >= 0) counts[j * columns + i]++;
    }
  const weights = Array.from({ length: 11 }, (_, k) => Math.exp(-((k - 5) ** 2) / (2 * BLUR * BLUR)));
  for (const step of [1, columns]) {
    const out = new Float32Array(counts.length);
    for (let at = 0; at < counts.length; at++) {
      if (!counts[at]) continue;
      const place = step === 1 ? at % columns : Math.floor(at / columns), last = step === 1 ? columns : rows;
      weights.forEach((weight, k) => place + k - 5 >= 0 && place + k - 5 < last && (out[at + (k - 5) * step] += weight * counts[at]));
    }
    counts = out;
  }
  const most = counts.reduce((a, b) => Math.max(a, b), 0) || 1;
  return counts.map((one) => one / most);
}

function Heat({ index, name }: { index: number; name: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const now = spec.value!;
  const found = result.value!;
  const all = shown.value;
  const dark = theme.value === "dark";
  const { x, y } = now.workspace;
  const [wide, deep] = [x[1] - x[0], y[1] - y[0]];
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    const { canvas: picture } = context, sharp = Math.min(devicePixelRatio || 1, 2);
    picture.width = Math.round((picture.clientWidth || 140) * sharp);
    picture.height = Math.round((picture.clientHeight || (140 * deep) / wide) * sharp);
    const cell = Math.max(wide, deep) / CELLS, columns = Math.max(2, Math.round(wide / cell)), rows = Math.max(2, Math.round(deep / cell));
    const image = context.createImageData(columns, rows);
    density(found, all, index, now.workspace, columns, rows).forEach((share, at) => {
      const row = rows - 1 - Math.floor(at / columns);
      image.data.set([...(dark ? [70, 190, 155] : [25, 110, 115]), 255 * Math.min(1, 1.3 * share)], 4 * (row * columns + (at % columns)));
    });
    const small = document.createElement("canvas");
    [small.width, small.height] = [columns, rows];
    small.getContext("2d")!.putImageData(image, 0, 0);
    // the table from above: regions and what is fixed, then how often the object stands where
    const scale = Math.min(picture.width / wide, picture.height / deep);
    const onTable = () => context.setTransform(scale, 0, 0, -scale, -scale * x[0], picture.height + scale * y[0]);
    onTable();
    context.lineWidth = sharp / scale;
    for (const one of now.regions) {
      outline(context, one.footprint, one.pose);
      context.fillStyle = dark ? "#2a3037" : "#efece0";
      context.fill();
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.imageSmoothingEnabled = true;
    context.drawImage(small, 0, 0, picture.width, picture.height);
    onTable();
    context.strokeStyle = dark ? "#77808c" : "#9a927a";
    for (const one of now.regions) {
      outline(context, one.footprint, one.pose);
      context.stroke();
    }
    context.strokeStyle = dark ? "#a0a6af" : "#6d6a60";
    for (const one of now.objects) {
      if (!one.fixed) continue;
      outline(context, one.footprint, one.fixed);
      context.stroke();
    }
  }, [now, found, all, dark, index]);
  return (
    <button class={`heat-map${thing.value === name ? " chosen" : ""}${lit.value === name ? " lit" : ""}`} onClick={() => (thing.value = thing.value === name ? null : name)} onMouseEnter={() => (lit.value = name)} onMouseLeave={() => (lit.value = null)} title={`where ${name} goes, of ${number(wide)} x ${number(deep)} m`}>
      <canvas ref={canvas} style={{ aspectRatio: `${wide} / ${deep}` }} />
      <span class="cut">{name}</span>
    </button>
  );
}
