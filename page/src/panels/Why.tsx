// The formulas as trees, coloured by the value of each part in the scene that is shown.
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { frame, rest, seconds, seek, timed } from "../motions";
import { asWritten } from "../said";
import { decides, edited, label, alone, lit, pointed, report, spec } from "../state";
import type { Decides, Line } from "../types";
import { lightWord, mentions, Named } from "./Named";
import { number, signed } from "../words";

const wholly = signal(true); // of a motion: the values that count for the whole, not those at the moment shown

export function Why() {
  const now = spec.value;
  if (!now) return <p class="empty">Correct the spec to see its formula.</p>;
  const labels = Object.keys(now.trees);
  const shown = labels.includes(label.value) ? label.value : labels[0];
  const one = decides.value;
  const phi = (one?.required ? report.value?.require : report.value?.phi[label.value])?.[0];
  const margin = one?.required ? "the margin" : "phi";
  return (
    <div class="why">
      <div class="tabs small" role="tablist" aria-label="formula">
        {labels.map((name) => {
          const value = name === "require" ? report.value?.require?.[0] : report.value?.phi[name]?.[0];
          return (
            <button key={name} role="tab" aria-selected={name === shown} onClick={() => (label.value = name)}>
              <span class="cut" title={name}>{name}</span> {value !== undefined && value !== null ? <b class={value >= 0 ? "good" : "bad"}>{signed(value)}</b> : null}
            </button>
          );
        })}
      </div>
      {one ? (
        <p class="decider"><span class={`dot ${one.value >= 0 ? "good" : "bad"}`} /> <code onMouseMove={lightWord} onMouseOut={() => (lit.value = null)}><Named>{asWritten(one)}</Named></code>{one.moment === undefined ? "" : <> <button class="when" onClick={() => { rest(); seek(one.moment!); }}>at {seconds(one.moment)}</button></>}{phi === undefined || phi === one.value ? ` sets ${margin}.${one.settled ? " No move of an object on its surface changes it." : ""}` : <> is {signed(one.value)}. <Keeper one={one.keeper} /> keeps {margin} at {signed(phi)}.</>}</p>
      ) : null}
      {now.time ? (
        <div class="segment small" role="group" aria-label="values">
          <button aria-pressed={wholly.value} onClick={() => (wholly.value = true)}>of the whole motion</button>
          <button aria-pressed={!wholly.value} onClick={() => (wholly.value = false)} disabled={!report.value?.over} title={report.value?.over ? "from the shown moment to the end" : alone ? "a page without a server has only the values of the whole motion" : "there are too many moments and formulas for this"}>from {seconds(frame.value)} to the end</button>
        </div>
      ) : null}
      <ul class="tree" role="tree" aria-label={`formula of ${shown}`}>
        <Node line={now.trees[shown]} />
      </ul>
      {alone && edited.value ? <p class="note">The scene was moved by hand: this page has no server that computes its phi.</p> : null}
      {report.value?.overlaps?.length ? <p class="note">Overlapping{now.time ? " at the last moment" : ""}: {report.value.overlaps.slice(0, MOST).map((pair) => pair.join(" and ")).join(", ")}{report.value.overlaps.length > MOST ? `, and ${number(report.value.overlaps.length - MOST, 6)} pairs more` : ""}.</p> : null}
    </div>
  );
}

const MOST = 5; // pairs that overlap

/** The part that is phi, where another one is explained. */
function Keeper({ one }: { one?: Decides }) {
  if (!one) return <>Another part, the same in every scene,</>;
  return <><code>{asWritten(one)}</code>, which is the same wherever objects stand on their surfaces,</>;
}

function Node({ line }: { line: Line }) {
  const [open, setOpen] = useState(line.kind !== "atom");
  const over = timed.value && !wholly.value ? report.value?.over?.[line.line] : undefined;
  const value = (over ? over[frame.value] : report.value?.values?.[line.line]) ?? null;
  const when = timed.value && wholly.value && line.kind === "atom" ? report.value?.at?.[line.line] : undefined;
  const mine = decides.value?.lines.includes(line.line) ?? false;
  const [low, high] = line.bounds;
  const most = Math.max(Math.abs(low ?? 1), Math.abs(high ?? 1), 1e-9);
  const share = value === null ? 0 : Math.min(1, Math.abs(value) / most) ** 0.5;
  const mentioned = line.kind === "atom" && lit.value !== null && mentions(`${line.text} ${line.margin}`, lit.value);
  const words = line.kind === "atom" ? asWritten(line) : line.kind === "time" ? "" : line.text.replace(/^(all|one) of:? ?/, "");
  return (
    <li role="treeitem" aria-expanded={line.parts.length ? open : undefined} class={line.kind}>
      <div class={`row${mine ? " decides" : ""}${mentioned ? " lit" : ""}`} style={value === null ? undefined : { "--share": `${Math.round(100 * share)}%` }} data-sign={value === null ? "" : value >= 0 ? "good" : "bad"} title={line.margin ? `${line.margin}${line.unit ? ` (${line.unit})` : ""}` : undefined}
        onMouseEnter={() => (pointed.value = line.line)} onMouseLeave={() => (pointed.value = null)} onMouseMove={lightWord} onMouseOut={() => (lit.value = null)}>
        {line.parts.length ? <button class="twist" aria-label={open ? "fold" : "unfold"} onClick={() => setOpen(!open)}>{open ? "▾" : "▸"}</button> : <span class="twist" />}
        {line.kind !== "atom" ? <span class={`kind ${line.kind}`}>{line.kind === "time" ? line.text : line.kind === "all" ? "all of" : "one of"}</span> : null}
        {when !== undefined ? <button class="when" title="the moment that counts" onClick={() => { rest(); seek(when); }}>{seconds(when)}</button> : null}
        <code>{line.count ? `${line.count} × ` : ""}<Named>{words}</Named></code>
        <span class="value">{value === null ? "" : signed(value)}</span>
      </div>
      {open && line.parts.length ? <ul role="group">{line.parts.map((part) => <Node key={part.line} line={part} />)}{line.more ? <li class="more" role="treeitem">{number(line.more)} more</li> : null}</ul> : null}
    </li>
  );
}
