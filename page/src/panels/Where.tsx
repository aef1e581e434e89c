// Over all scenes: how phi is spread, and where each object goes.
import { useEffect, useRef } from "preact/hooks";
import { moments } from "../motions";
import { result, shown, spec, thing } from "../state";
import { select } from "../store";
import { theme } from "../theme";
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
      <figcaption><b>{name}</b> phi {number(low)} to {number(high)}, mean {number(values.reduce((a, b) => a + b, 0) / values.length)}</figcaption>
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

function Heat({ index, name }: { index: number; name: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const now = spec.value!;
  const found = result.value!;
  const all = shown.value;
  const dark = theme.value === "dark";
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    const { x, y } = now.workspace;
    const { width, height } = context.canvas;
    const cells = 28;
    const counts = new Float32Array(cells * cells);
    const spread = all.length > 100 ? 1 : 1.6;
    let most = 0;
    for (const k of all) {
      for (const scene of found.poses[k] ? moments(found, k) : []) {
      const pose = scene[index];
      if (!pose) continue;
      const cx = (cells * (pose[0] - x[0])) / (x[1] - x[0]), cy = (cells * (pose[1] - y[0])) / (y[1] - y[0]);
      for (let i = Math.floor(cx - 4); i <= cx + 4; i++)
        for (let j = Math.floor(cy - 4); j <= cy + 4; j++)
          if (i >= 0 && j >= 0 && i < cells && j < cells) {
            const d2 = (i + 0.5 - cx) ** 2 + (j + 0.5 - cy) ** 2;
            const at = j * cells + i;
            counts[at] += Math.exp(-d2 / (2 * spread * spread));
            most = Math.max(most, counts[at]);
          }
      }
    }
    const image = context.createImageData(cells, cells);
    for (let j = 0; j < cells; j++)
      for (let i = 0; i < cells; i++) {
        const share = most ? counts[j * cells + i] / most : 0;
        const at = 4 * ((cells - 1 - j) * cells + i);
        image.data.set(dark ? [70, 190, 155] : [255 - 230 * share, 250 - 140 * share, 235 - 120 * share], at);
        image.data[at + 3] = 255 * Math.min(1, (dark ? 0 : 0.06) + 1.4 * share);
      }
    const small = document.createElement("canvas");
    small.width = small.height = cells;
    small.getContext("2d")!.putImageData(image, 0, 0);
    context.clearRect(0, 0, width, height);
    context.imageSmoothingEnabled = true;
    context.drawImage(small, 0, 0, width, height);
  });
  return (
    <button class={`heat-map${thing.value === name ? " chosen" : ""}`} onClick={() => (thing.value = thing.value === name ? null : name)} title={`where ${name} goes`}>
      <canvas ref={canvas} width={112} height={112} />
      <span>{name}</span>
    </button>
  );
}
