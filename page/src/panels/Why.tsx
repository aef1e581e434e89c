// The formulas as trees, coloured by the value of each part in the scene that is shown.
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { frame, rest, seconds, seek, timed } from "../motions";
import { decides, edited, label, alone, pointed, report, spec, text } from "../state";
import type { Line } from "../types";
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
              {name} {value !== undefined && value !== null ? <b class={value >= 0 ? "good" : "bad"}>{signed(value)}</b> : null}
            </button>
          );
        })}
      </div>
      {one ? (
        <p class="decider"><span class={`dot ${one.value >= 0 ? "good" : "bad"}`} /> <code>{asWritten(one)}</code>{one.moment === undefined ? "" : <> <button class="when" onClick={() => { rest(); seek(one.moment!); }}>at {seconds(one.moment)}</button></>}{phi === undefined || phi === one.value ? ` sets ${margin}.` : ` is ${signed(one.value)}. Another part, the same in every scene, keeps ${margin} at ${signed(phi)}.`}</p>
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
      {report.value?.overlaps?.length ? <p class="note">Overlapping{now.time ? " at the last moment" : ""}: {report.value.overlaps.map((pair) => pair.join(" and ")).join(", ")}.</p> : null}
    </div>
  );
}

const CONSTANT = /^([\d.]+\s*(mm|cm|m|deg|rad|turn)?|[A-Z][A-Z0-9_]*)$/;

/** An atom with its constants as the spec has them: `20 deg` and not 0.349066. */
export function asWritten({ text: line, spans }: Pick<Line, "text" | "spans">): string {
  if (!spans.length) return line;
  const source = [...text.value].slice(...spans[spans.length - 1]).join("");
  const [mine, theirs] = [parts(line), parts(source)];
  if (!mine || !theirs || mine.name !== theirs.name || mine.args.length !== theirs.args.length) return line;
  return `${mine.name}(${mine.args.map((arg, k) => (/^-?[\d.]+$/.test(arg) && CONSTANT.test(theirs.args[k]) ? theirs.args[k] : arg)).join(", ")})`;
}

/** The name and the arguments of a plain call. */
function parts(call: string): { name: string; args: string[] } | null {
  const found = call.match(/^(\w+)\(([^()]*)\)$/s);
  return found && { name: found[1], args: found[2].split(",").map((one) => one.trim()) };
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
  const words = line.kind === "atom" ? asWritten(line) : line.kind === "time" ? "" : line.text.replace(/^(all|one) of:? ?/, "");
  return (
    <li role="treeitem" aria-expanded={line.parts.length ? open : undefined} class={line.kind}>
      <div class={`row${mine ? " decides" : ""}`} style={value === null ? undefined : { "--share": `${Math.round(100 * share)}%` }} data-sign={value === null ? "" : value >= 0 ? "good" : "bad"} title={line.margin ? `${line.margin}${line.unit ? ` (${line.unit})` : ""}` : undefined}
        onMouseEnter={() => (pointed.value = line.line)} onMouseLeave={() => (pointed.value = null)}>
        {line.parts.length ? <button class="twist" aria-label={open ? "fold" : "unfold"} onClick={() => setOpen(!open)}>{open ? "▾" : "▸"}</button> : <span class="twist" />}
        {line.kind !== "atom" ? <span class={`kind ${line.kind}`}>{line.kind === "time" ? line.text : line.kind === "all" ? "all of" : "one of"}</span> : null}
        {when !== undefined ? <button class="when" title="the moment that counts" onClick={() => { rest(); seek(when); }}>{seconds(when)}</button> : null}
        <code>{line.count ? `${line.count} × ` : ""}{words}</code>
        <span class="value">{value === null ? "" : signed(value)}</span>
      </div>
      {open && line.parts.length ? <ul role="group">{line.parts.map((part) => <Node key={part.line} line={part} />)}{line.more ? <li class="more" role="treeitem">{number(line.more)} more</li> : null}</ul> : null}
    </li>
  );
}
