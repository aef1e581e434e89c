// A motion of an object played back, with phi over time.
import { play, seek } from "../hands";
import { label, moment, motion, replaying } from "../state";
import { number } from "../words";

const WIDE = 300, HIGH = 150;
const INKS = ["var(--ink-1)", "var(--ink-2)", "var(--ink-3)", "var(--ink-4)"];

export function MotionPanel() {
  const one = motion.value;
  if (!one) return <p class="empty">Drag or turn an object in the scene, or move it with the arrow keys: its motion is recorded here, with phi over time.</p>;
  const last = one.times[one.times.length - 1] || 1e-9;
  const lines = Object.entries(one.phi ?? {}).slice(0, 4);
  const all = lines.flatMap(([, values]) => values);
  const low = Math.min(0, ...all), high = Math.max(0, ...all);
  const pad = 0.08 * Math.max(high - low, 1e-6);
  const toX = (time: number) => 4 + ((WIDE - 8) * time) / last;
  const toY = (phi: number) => HIGH - 16 - ((HIGH - 26) * (phi - low + pad)) / (high - low + 2 * pad);
  const at = one.times.findIndex((time) => time >= moment.value);
  return (
    <div class="motion">
      <p><b>{one.name}</b> moved for {last.toFixed(1)} s</p>
      <svg viewBox={`0 0 ${WIDE} ${HIGH}`} role="img" aria-label="phi over time" onPointerDown={(event) => { const box = event.currentTarget.getBoundingClientRect(); seek(Math.min(Math.max((((event.clientX - box.left) / box.width) * WIDE - 4) / (WIDE - 8), 0), 1) * last); }}>
        <rect x={0} y={0} width={WIDE} height={toY(0)} class="above" />
        <line x1={0} x2={WIDE} y1={toY(0)} y2={toY(0)} class="zero" />
        {lines.map(([name, values], k) => <path key={name} d={`M${values.map((phi, j) => `${toX(one.times[j]).toFixed(1)} ${toY(phi).toFixed(1)}`).join("L")}`} stroke={INKS[k]} class={`path${name === label.value ? " chosen" : ""}`} />)}
        <line x1={toX(moment.value)} x2={toX(moment.value)} y1={4} y2={HIGH - 14} class="head" />
        {at >= 0 ? lines.map(([name, values], k) => <circle key={name} cx={toX(moment.value)} cy={toY(values[at])} r={3.4} fill={INKS[k]} />) : null}
        <text x={2} y={HIGH - 3} class="tick">0 s</text>
        <text x={WIDE - 2} y={HIGH - 3} class="tick" text-anchor="end">{last.toFixed(1)} s</text>
      </svg>
      <div class="legend">{lines.map(([name, values], k) => <span key={name}><i style={{ background: INKS[k] }} />{name} {at >= 0 ? number(values[at]) : ""}</span>)}</div>
      <div class="row">
        <button class="strong" onClick={play}>{replaying.value ? "Pause" : "Play"} <kbd>p</kbd></button>
        <input type="range" min={0} max={last} step={last / 200} value={moment.value} aria-label="time of the motion" onInput={(event) => { replaying.value = false; seek(Number(event.currentTarget.value)); }} />
      </div>
    </div>
  );
}
