// phi of the large motion over time, with the moment that decides; and what plays it.
import { useRef } from "preact/hooks";
import { clock, frame, path, playing, playMotion, rate, rest, seconds, seek, stepBy, timed, usual } from "../motions";
import { decides, label, report } from "../state";
import { signed } from "../words";
import { asWritten } from "../said";

const HIGH = 100, WIDE = 1000;
const EXPONENTS = [-3, -2, -1, 0, 1, 2, 3];

type Row = (number | null)[];

export function Timeline() {
  const plot = useRef<HTMLDivElement>(null);
  const held = useRef(false);
  const now = timed.value;
  if (!now || !path.value.length) return null;
  const signals: Record<string, Row> = report.value?.signals ?? {};
  const one = decides.value;
  const atom: Row = one?.signal ?? [];
  const mine: Row = signals[label.value] ?? [];
  const others = Object.entries(signals).filter(([name]) => name !== label.value && name !== "require").slice(0, 4);
  const all = [...mine, ...atom, ...others.flatMap(([, row]) => row)].filter((phi): phi is number => phi !== null);
  const low = Math.min(0, ...least(all)), high = Math.max(0, ...most(all));
  const pad = 0.1 * Math.max(high - low, 1e-6);
  const share = (t: number) => t / now.steps;
  const toY = (phi: number) => (HIGH * (high + pad - phi)) / (high - low + 2 * pad);
  const here = mine[frame.value];
  const go = (event: PointerEvent) => {
    const box = plot.current!.getBoundingClientRect();
    rest();
    seek(Math.round(((event.clientX - box.left) / box.width) * now.steps));
  };
  const speed = rate.value ?? usual();
  return (
    <section class="timeline" aria-label="motion over time">
      <div class="controls">
        <button class="tool" onClick={() => stepBy(-1)} aria-label="one step back" title="one step back (←)" disabled={frame.value === 0}>‹</button>
        <button class="strong play" onClick={playMotion} title="play (space)" aria-label={playing.value ? "pause" : "play"}>{playing.value ? "❚❚" : "▶"}</button>
        <button class="tool" onClick={() => stepBy(1)} aria-label="one step forward" title="one step forward (→)" disabled={frame.value === now.steps}>›</button>
        <span class="time"><b>{seconds(frame.value)}</b> <span class="of">of {seconds(now.steps)}</span></span>
        <label class="speed"><span>speed</span> <select aria-label="speed" value={String(speed)} onChange={(event) => (rate.value = Number(event.currentTarget.value))}>{EXPONENTS.map((k) => usual() * 2 ** k).concat(EXPONENTS.some((k) => usual() * 2 ** k === speed) ? [] : [speed]).map((value) => <option key={value} value={String(value)}>{times(value)}</option>)}</select></label>
        {one && one.moment !== undefined ? <button class={`tool decided ${one.value >= 0 ? "good" : "bad"}`} onClick={() => { rest(); seek(one.moment!); }} title={`${asWritten(one)} sets ${one.required ? "the margin" : "phi"} at this moment`}>phi is set at {seconds(one.moment)}</button> : null}
      </div>
      <div class="plot" ref={plot} onPointerDown={(event) => { held.current = true; plot.current!.setPointerCapture(event.pointerId); go(event); }} onPointerMove={(event) => held.current && go(event)} onPointerUp={() => (held.current = false)} onPointerCancel={() => (held.current = false)}>
        <svg viewBox={`0 0 ${WIDE} ${HIGH}`} preserveAspectRatio="none" role="img" aria-label={`phi of ${label.value} over time`}>
          <rect x={0} y={0} width={WIDE} height={Math.max(0, toY(0))} class="above" />
          <line x1={0} x2={WIDE} y1={toY(0)} y2={toY(0)} class="zero" />
          {others.map(([name, row]) => <path key={name} d={line(row, share, toY)} class="other" />)}
          {one?.moment !== undefined ? <line x1={0} x2={WIDE * share(one.moment)} y1={toY(one.value)} y2={toY(one.value)} class="level" /> : null}
          <path d={line(atom, share, toY)} class="atom" />
          <path d={line(mine, share, toY)} class="mine" />
        </svg>
        {one && one.moment !== undefined ? <i class={`decider-dot ${one.value >= 0 ? "good" : "bad"}`} style={{ left: `${100 * share(one.moment)}%`, top: `${toY(one.value)}%` }} /> : null}
        <i class="now" style={{ left: `${100 * share(clock.value)}%` }} />
        <span class="high">{signed(high)}</span>
        <span class="low">{signed(low)}</span>
      </div>
      <input type="range" min={0} max={now.steps} step={1} value={frame.value} aria-label="moment" aria-valuetext={`${seconds(frame.value)}${typeof here === "number" ? `, phi from this moment to the end ${signed(here)}` : ""}`} onInput={(event) => { rest(); seek(Number(event.currentTarget.value)); }} />
      <p class="legend"><span><i class="mine" /><b class="value">{typeof here === "number" ? signed(here) : "–"}</b> <span class="cut" title={`${label.value} from this moment to the end`}>{label.value} from this moment to the end</span></span>{one && atom.length ? <span class="atom-name"><i class="atom" /><b class="value">{typeof atom[frame.value] === "number" ? signed(atom[frame.value]!) : "–"}</b> <code class="cut" title={asWritten(one)}>{asWritten(one)}</code></span> : null}</p>
    </section>
  );
}

/** Minima of long lists: a call takes only so many arguments. */
function least(all: number[]): number[] {
  return all.length ? [all.reduce((a, b) => Math.min(a, b))] : [];
}

function most(all: number[]): number[] {
  return all.length ? [all.reduce((a, b) => Math.max(a, b))] : [];
}

/** A line through what is finite. */
function line(row: Row, share: (t: number) => number, toY: (phi: number) => number): string {
  let found = "", pen = "M";
  row.forEach((phi, t) => {
    if (phi === null) pen = "M";
    else {
      found += `${pen}${(WIDE * share(t)).toFixed(1)} ${toY(phi).toFixed(2)}`;
      pen = "L";
    }
  });
  return found;
}

function times(value: number): string {
  return value >= 1 ? `× ${value}` : `÷ ${1 / value}`;
}
