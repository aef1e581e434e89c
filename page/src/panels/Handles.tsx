// The range of one label as two handles over the plot of how rare each phi is.
import { useRef, useState } from "preact/hooks";
import { band, justSolved, probability } from "../rare";
import { alone, label as chosenLabel, measuring, preview, rarity, request, result, shown, spec } from "../state";
import { setEnds } from "../store";
import type { Ends } from "../types";
import { grade } from "../said";
import { measure, number, oneIn, round } from "../words";

const WIDE = 300, HIGH = 86, FOOT = 20;

export function Handles({ name }: { name: string }) {
  const svg = useRef<SVGSVGElement>(null);
  const drag = useRef<0 | 1 | null>(null);
  const now = spec.value!;
  const known = rarity.value[name];
  const bounds = now.labels.find((one) => one.name === name)!.bounds;
  let [low, high] = known ? known.reached : bounds;
  const found = result.value?.phi[name] ?? [];
  if (!known && found.length) {
    low = Math.min(low, ...found);
    high = Math.max(high, ...found);
  }
  const pad = 0.03 * Math.max(high - low, 1e-6);
  low -= pad;
  high += pad;
  const ends: Ends = request.value.phi[name] ?? [null, null];
  // What is satisfied is often a sliver of what occurs: either side of 0 gets at least two fifths of the width.
  const split = low < 0 && high > 0 ? Math.min(Math.max(-low / (high - low), 0.4), 0.6) : null;
  const toX = (value: number) => {
    const phi = Math.min(Math.max(value, low), high);
    if (split === null) return (WIDE * (phi - low)) / (high - low);
    return phi < 0 ? WIDE * split * (1 - phi / low) : WIDE * (split + ((1 - split) * phi) / high);
  };
  const fromX = (x: number) => {
    const share = Math.min(Math.max(x / WIDE, 0), 1);
    if (split === null) return low + (high - low) * share;
    return share < split ? low * (1 - share / split) : (high * (share - split)) / (1 - split);
  };

  let area = "", line = "";
  const curve = known?.curve ?? [];
  const told = curve.flatMap((point) => [point[1], point[2]]).filter((one): one is number => one !== null);
  const floor = Math.min(-1.2, ...told) * 1.04;
  const rare = (point: [number, number | null, number | null]) => Math.min(point[1] ?? floor, point[2] ?? floor); // null: too rare to tell
  const toY = (log: number) => 6 + ((HIGH - FOOT - 6) * Math.max(log, floor)) / floor;
  if (curve.length > 1) {
    line = curve.map((point) => `${toX(point[0]).toFixed(1)} ${toY(rare(point)).toFixed(1)}`).join("L");
    area = `M${toX(curve[0][0])} ${HIGH - FOOT}L${line}L${toX(curve[curve.length - 1][0])} ${HIGH - FOOT}Z`;
  }
  const what = now.time ? "motions" : "scenes";
  const log = known ? probability(known, ends) : null;

  const set = (which: 0 | 1, phi: number | null) => {
    const next: Ends = [...ends];
    next[which] = phi === null ? null : Math.abs(toX(phi) - toX(0)) < 3 && split !== null ? 0 : round(Math.min(Math.max(phi, low), high), 3);
    // A handle pushed to its end is an open end; handles push each other.
    if (phi !== null && which === 0 && toX(phi) <= 4) next[0] = null;
    if (phi !== null && which === 1 && toX(phi) >= WIDE - 4) next[1] = null;
    const gap = 8; // of the plot's width, in its units
    if (next[0] !== null && next[1] !== null && toX(next[1]) - toX(next[0]) < gap)
      next[1 - which] = which === 0 ? round(fromX(Math.min(toX(next[0]) + gap, WIDE)), 3) : round(fromX(Math.max(toX(next[1]) - gap, 0)), 3);
    if (next[0] !== null && next[1] !== null && next[0] >= next[1]) return;
    setEnds(name, next);
  };
  const at = (event: PointerEvent) => {
    const box = svg.current!.getBoundingClientRect();
    return fromX(((event.clientX - box.left) / box.width) * WIDE);
  };
  const down = (event: PointerEvent) => {
    const phi = at(event);
    const [a, b] = [ends[0] ?? low, ends[1] ?? high];
    drag.current = Math.abs(toX(phi) - toX(a)) <= Math.abs(toX(phi) - toX(b)) && !(phi > b) ? 0 : 1;
    svg.current!.setPointerCapture(event.pointerId);
    svg.current!.querySelectorAll<SVGGElement>("[role=slider]")[drag.current].focus();
    set(drag.current, phi);
    event.preventDefault();
  };
  const keys = (which: 0 | 1) => (event: KeyboardEvent) => {
    const by = event.shiftKey ? 30 : 4;
    const x = toX(ends[which] ?? (which ? high : low));
    const steps: Record<string, number | null> = { ArrowLeft: fromX(x - by), ArrowDown: fromX(x - by), ArrowRight: fromX(x + by), ArrowUp: fromX(x + by), PageDown: fromX(x - 40), PageUp: fromX(x + 40), Home: which ? fromX(12) : null, End: which ? null : fromX(WIDE - 12) };
    if (!(event.key in steps)) return;
    event.preventDefault();
    event.stopPropagation();
    set(which, steps[event.key]);
  };
  const zero = low < 0 && high > 0 ? toX(0) : null;
  const [a, b] = [toX(ends[0] ?? low), toX(ends[1] ?? high)];
  // What is typed and not yet taken, so that scenes that arrive do not overwrite it; it ends when the range changes otherwise.
  const [draft, setDraft] = useState<{ which: 0 | 1; value: string; wrong: string; of: Ends } | null>(null);
  const open = draft && draft.of[0] === ends[0] && draft.of[1] === ends[1] ? draft : null;
  const write = (which: 0 | 1, value: string, wrong = "") => setDraft({ which, value, wrong, of: [...ends] });
  const take = (which: 0 | 1, text: string) => {
    const value = text.trim();
    const phi = value === "" ? null : measure(value);
    const next: Ends = [...ends];
    next[which] = phi;
    if (value !== "" && phi === null) write(which, value, `${value} is no number here: write 0.02, or 2 cm, or 10 deg`);
    else if (next[0] !== null && next[1] !== null && next[0] > next[1]) write(which, value, "from is larger than to");
    else {
      setDraft(null);
      setEnds(name, next);
    }
  };
  const field = (which: 0 | 1, word: string) => (
    <label>{word} <input type="text" inputMode="decimal" value={open?.which === which ? open.value : ends[which] === null ? "" : String(ends[which])} placeholder="open" aria-invalid={open?.which === which && open.wrong !== ""} onInput={(event) => write(which, event.currentTarget.value)} onChange={(event) => take(which, event.currentTarget.value)} aria-label={`${word}, ${name}`} /></label>
  );
  const tick = (phi: number) => number(Math.abs(phi) < 1e-6 * (high - low) ? 0 : phi);
  return (
    <section class={`label-box${chosenLabel.value === name ? " chosen" : ""}`} data-label={name}>
      <header>
        <button class="label-name" onClick={() => (chosenLabel.value = name)} title={`explain ${name}`} aria-pressed={chosenLabel.value === name}>{name}</button>
        <span class="rare" title={`how many of all ${what} lie in this range`}>{log !== null ? (log === 0 ? `all ${what}` : oneIn(log, what)) : known ? "too rare to tell" : measuring.value ? "measuring how rare…" : ""}</span>
      </header>
      <svg ref={svg} class="handles" viewBox={`0 0 ${WIDE} ${HIGH}`} onPointerDown={down} onPointerMove={(event) => drag.current !== null && set(drag.current, at(event))} onPointerUp={() => (drag.current = null)} onPointerCancel={() => (drag.current = null)}>
        <defs>
          <clipPath id={`in-${name}`}><rect x={a} y={0} width={Math.max(b - a, 0)} height={HIGH} /></clipPath>
        </defs>
        {area ? <path d={area} class="area out" /> : <rect x={0} y={HIGH - FOOT - 14} width={WIDE} height={14} class="area out" />}
        <g clip-path={`url(#in-${name})`}>
          {area ? <path d={area} class="area in" /> : <rect x={0} y={HIGH - FOOT - 14} width={WIDE} height={14} class="area in" />}
        </g>
        {line ? <path d={`M${line}`} class="curve" /> : null}
        <line x1={0} x2={WIDE} y1={HIGH - FOOT} y2={HIGH - FOOT} class="axis" />
        {zero !== null ? (
          <g>
            <line x1={zero} x2={zero} y1={4} y2={HIGH - FOOT + 4} class="zero" />
          </g>
        ) : null}
        {found.map((phi, k) => (shown.value.includes(k) ? <line key={k} x1={toX(phi)} x2={toX(phi)} y1={HIGH - FOOT + 1} y2={HIGH - FOOT + 6} class={`rug${preview.value ? " early" : ""}`} /> : null))}
        <text x={1} y={HIGH - 2} class="tick">{tick(low + pad)}</text>
        <text x={WIDE - 1} y={HIGH - 2} class="tick" text-anchor="end">{tick(high - pad)}</text>
        {zero !== null ? <>
          <text x={zero / 2} y={11} class="tick side bad" text-anchor="middle">fails</text>
          <text x={zero + 8} y={11} class="tick side good">barely</text>
          <text x={WIDE - 12} y={11} class="tick side good" text-anchor="end">clearly</text>
        </> : null}
        {zero !== null && zero > 42 && zero < WIDE - 36 ? <text x={zero} y={HIGH - 2} class="tick" text-anchor="middle">0</text> : null}
        {([0, 1] as const).map((which) => {
          const x = which ? b : a;
          const value = ends[which] ?? (which ? high : low);
          return (
            <g key={which} role="slider" tabindex={0} class={`handle${ends[which] === null ? " open" : ""}`} aria-label={`${which ? "highest" : "lowest"} phi of ${name}`} aria-valuemin={round(low)} aria-valuemax={round(high)} aria-valuenow={round(value)} aria-valuetext={ends[which] === null ? "open" : `${number(value)}, ${grade(value, name)}`} onKeyDown={keys(which)} transform={`translate(${Math.min(Math.max(x, 3), WIDE - 3)} 0)`}>
              <rect x={-9} y={0} width={18} height={HIGH - FOOT + 6} fill="transparent" />
              <line y1={2} y2={HIGH - FOOT} />
              <rect class="grip" x={-4.5} y={(HIGH - FOOT) / 2 - 9} width={9} height={20} rx={4.5} />
            </g>
          );
        })}
      </svg>
      <p class="caption" hidden={name !== now.labels[0].name}>{area ? `Height: how common ${what} with such a phi are (lower is much rarer). ` : ""}Left of 0 the formula fails; right of it it is satisfied, first barely, at the end clearly. Drag the handles to choose the range of phi.</p>
      <div class="ends">
        {field(0, "from")}
        {field(1, "to")}
      </div>
      {open?.wrong ? <p class="wrong" role="alert">{open.wrong}</p> : null}
      <div class="chips">
        <Chip title={`the tenth of all ${what} with the lowest phi: farthest from being satisfied`} disabled={!known?.bands.some((one) => one.name === "hard")} onClick={() => band("hard", name)}>lowest 10 %</Chip>
        <Chip title={`a range around the median phi of all ${what}`} disabled={!known?.bands.some((one) => one.name === "medium")} onClick={() => band("medium", name)}>middle</Chip>
        <Chip title="phi a little above 0" disabled={high <= 0} onClick={() => justSolved(name)}>barely satisfied</Chip>
        <Chip title="phi of 0 or more" disabled={high <= 0} onClick={() => setEnds(name, [0, null])}>satisfied</Chip>
        <Chip title="any phi" onClick={() => setEnds(name, [null, null])}>{alone ? "all" : "any"}</Chip>
      </div>
    </section>
  );
}

function Chip({ children, onClick, disabled, title }: { children: string; onClick: () => void; disabled?: boolean; title: string }) {
  return <button class="chip" title={title} onClick={onClick} disabled={disabled}>{children}</button>;
}
