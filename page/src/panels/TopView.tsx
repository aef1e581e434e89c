// The scene from above: names, headings, dimension lines, and hands on the objects.
import { useRef } from "preact/hooks";
import { hold, moved, place } from "../hands";
import { marks as measured, moments, trails } from "../motions";
import { bases, heat, lit, movable, names, poses, request, result, shown, spec, thing } from "../state";
import { at, EDGES, lowestFirst, TINTS } from "../scene/top2d";
import type { Footprint, Mark, Spec } from "../types";
import { apart, PIXELS, shortened, type Box, type Letters, type Tag } from "../scene/apart";
import { outline, reach } from "../scene/reach";
import { corner } from "../scene/stage3d";
import { cameraNames, Frames, Hands, Rings, share, UsualPlaces } from "./Sights";
import { number, round125, spoken, spokenText } from "../words";

function path(footprint: Footprint): string {
  if (footprint.kind === "circle") {
    const r = footprint.radius!;
    return `M${r} 0A${r} ${r} 0 1 1 ${-r} 0A${r} ${r} 0 1 1 ${r} 0Z`;
  }
  return `M${footprint.corners!.map((one) => one.join(" ")).join("L")}Z`;
}

function Dimension({ mark, side }: { mark: Mark; side: number }) {
  const wide = 0.0032 * side;
  if (mark.kind === "guide")
    return <line x1={mark.start[0]} y1={mark.start[1]} x2={mark.end[0]} y2={mark.end[1]} class="guide" stroke-width={0.6 * wide} stroke-dasharray={`${0.012 * side} ${0.009 * side}`} />;
  const kind = mark.good ? "mark good" : "mark bad";
  if (mark.kind === "line") {
    const [dx, dy] = [mark.end[0] - mark.start[0], mark.end[1] - mark.start[1]];
    const length = Math.hypot(dx, dy) || 1e-9;
    const tick = (0.014 * side) / length;
    const ticks = [mark.start, mark.end].map(([x, y], k) => <line key={k} x1={x + dy * tick} y1={y - dx * tick} x2={x - dy * tick} y2={y + dx * tick} />);
    return (
      <g class={kind} stroke-width={wide}>
        <line x1={mark.start[0]} y1={mark.start[1]} x2={mark.end[0]} y2={mark.end[1]} />
        {ticks}
      </g>
    );
  }
  const r = 0.09 * side;
  const point = (angle: number) => `${mark.center[0] + r * Math.cos(angle)} ${mark.center[1] + r * Math.sin(angle)}`;
  const large = Math.abs(mark.to - mark.from) > Math.PI ? 1 : 0;
  return (
    <g class={kind} stroke-width={wide}>
      <path d={`M${mark.center.join(" ")}L${point(mark.from)}A${r} ${r} 0 ${large} ${mark.to > mark.from ? 1 : 0} ${point(mark.to)}L${mark.center.join(" ")}`} />
    </g>
  );
}

/** A text that stands upright in a picture whose y axis points upwards. */
function Text({ x, y, size, kind, children }: { x: number; y: number; size: number; kind: string; children: string }) {
  return (
    <text transform={`translate(${x} ${y}) scale(1 -1)`} font-size={size} class={kind} text-anchor="middle" dominant-baseline="central">
      {children}
    </text>
  );
}

/** The names of regions where they are written: one above the other stand side by side, with their heights. */
function named(now: Spec): { x: number; y: number; text: string }[] {
  const found = new Map<string, { x: number; y: number; text: string }>();
  for (const { name, pose, height } of now.regions) {
    const key = `${pose[0]} ${pose[1]}`, words = height ? `${name} at ${number(100 * height)} cm` : name;
    const one = found.get(key);
    if (one) one.text += `, ${words}`;
    else found.set(key, { x: pose[0], y: pose[1], text: words });
  }
  return [...found.values()];
}

/** Where x and y go, and how long a round length is: before the front left corner of the workspace. */
function Axes({ now, side }: { now: Spec; side: number }) {
  const long = round125(side / 6), tip = 0.02 * side;
  const [x, y] = corner(now);
  const head = (u: number, v: number, du: number, dv: number) => `M${u - du * tip - 0.6 * dv * tip} ${v - dv * tip - 0.6 * du * tip}L${u} ${v}L${u - du * tip + 0.6 * dv * tip} ${v - dv * tip + 0.6 * du * tip}`;
  return (
    <g class="axes">
      <path d={`M${x + long} ${y}H${x}V${y + long}${head(x + long, y, 1, 0)}${head(x, y + long, 0, 1)}`} stroke-width={0.0035 * side} />
      <Text x={x + long + tip} y={y} size={0.026 * side} kind="axis">x</Text>
      <Text x={x} y={y + long + tip} size={0.026 * side} kind="axis">y</Text>
      <Text x={x + 0.5 * long} y={y - 0.9 * tip} size={0.022 * side} kind="axis">{spoken(long, "m")}</Text>
    </g>
  );
}

/** The names of objects beside them, each with a line where it had to move; y points down here. */
function nameTags(now: Spec, side: number): Tag[] {
  const high = 0.031 * side;
  const letters: Letters = { high, wide: (text) => ((PIXELS.wide(text) - 14) / 11.5) * 0.026 * side, within: true };
  const tags: Tag[] = [], boxes: Box[] = [];
  now.objects.forEach((one, k) => {
    const pose = poses.value[k];
    if (!pose) return;
    const [cos, sin] = [Math.cos(pose[2]), Math.sin(pose[2])];
    const xs = outline(one.footprint).map(([u, v]) => pose[0] + cos * u - sin * v), ys = outline(one.footprint).map(([u, v]) => -pose[1] - sin * u - cos * v);
    const of = { x0: Math.min(...xs), x1: Math.max(...xs), y0: Math.min(...ys), y1: Math.max(...ys) };
    boxes.push(of);
    const kind = thing.value === one.name ? "chosen" : lit.value === one.name ? "lit" : "name";
    const seen = share(now, k);
    if (kind !== "name" || names.value || seen || now.objects.length <= NAMED) tags.push({ x: 0, y: 0, kind, of, text: `${kind === "name" ? shortened(one.name) : one.name}${seen ? ` ${seen}` : ""}` });
  });
  const [x0, y0, x1, y1] = now.table;
  return apart(tags, boxes, { x0, x1, y0: -y1, y1: -y0 }, letters);
}

const NAMED = 12; // objects whose names are shown without having been asked for
const DOTS = 6000; // of a heat map, about: of long motions not every moment

function Heat({ now }: { now: Spec }) {
  const found = result.value;
  if (!found || !heat.value) return null;
  const index = now.objects.findIndex((one) => one.name === thing.value);
  const dots = [];
  for (const scene of shown.value) {
    const some = index >= 0 ? [index] : now.objects.map((_, k) => k);
    const all = moments(found, scene);
    const apart = Math.max(1, Math.ceil((all.length * shown.value.length * some.length) / DOTS));
    for (const k of some)
      for (let t = 0; t < all.length; t += apart) {
      const pose = all[t][k];
      dots.push(<circle key={`${scene} ${k} ${t}`} cx={pose[0]} cy={pose[1]} r={0.018 * Math.max(now.workspace.x[1] - now.workspace.x[0], now.workspace.y[1] - now.workspace.y[0])} fill={EDGES[k % EDGES.length]} />);
    }
  }
  return <g class="heat">{dots}</g>;
}

export function TopView() {
  const svg = useRef<SVGSVGElement>(null);
  const held = useRef<{ name: string; turn: boolean; dx: number; dy: number } | null>(null);
  const now = spec.value;
  if (!now) return null;
  const [x0, y0, x1, y1] = now.table;
  const { x, y } = now.workspace;
  const side = Math.max(x[1] - x[0], y[1] - y[0]);
  const line = 0.0022 * side;
  const step = side <= 3 ? 0.1 : side / 10;
  const grid = [];
  for (let k = Math.ceil(x[0] / step); k * step < x[1] && grid.length < 60; k++) grid.push(<line key={`x${k}`} x1={k * step} x2={k * step} y1={y[0]} y2={y[1]} />);
  for (let k = Math.ceil(y[0] / step); k * step < y[1] && grid.length < 120; k++) grid.push(<line key={`y${k}`} x1={x[0]} x2={x[1]} y1={k * step} y2={k * step} />);

  const where = (event: PointerEvent) => {
    const matrix = svg.current!.querySelector<SVGGElement>("g.metres")!.getScreenCTM()!.inverse();
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
    return [point.x, point.y];
  };
  const down = (name: string, turn: boolean) => (event: PointerEvent) => {
    event.stopPropagation();
    thing.value = name;
    const index = now.objects.findIndex((one) => one.name === name);
    if (!movable.value || now.objects[index].fixed) return;
    const [px, py] = where(event);
    held.current = { name, turn: turn || event.shiftKey, dx: poses.value[index][0] - px, dy: poses.value[index][1] - py };
    svg.current!.setPointerCapture(event.pointerId);
    event.preventDefault();
  };
  const move = (event: PointerEvent) => {
    const one = held.current;
    if (!one) return;
    const [px, py] = where(event);
    const index = now.objects.findIndex((two) => two.name === one.name);
    if (one.turn) place(one.name, { theta: Math.atan2(py - poses.value[index][1], px - poses.value[index][0]) });
    else place(one.name, { x: px + one.dx, y: py + one.dy });
  };
  const up = () => {
    if (held.current) void moved();
    held.current = null;
  };
  const marks = measured.value;
  return (
    <svg ref={svg} class="top" viewBox={`${x0} ${-y1} ${x1 - x0} ${y1 - y0}`} role="application" aria-label="scene from above" tabindex={0}
      onPointerMove={move} onPointerUp={up} onPointerCancel={up} onPointerDown={() => (thing.value = null)}>
      <g class="metres" transform="scale(1 -1)">
        <rect class="paper" x={x[0]} y={y[0]} width={x[1] - x[0]} height={y[1] - y[0]} />
        <g class="grid" stroke-width={0.5 * line}>{grid}</g>
        {now.regions.map((one) => <path key={one.name} d={path(one.footprint)} transform={at(one.pose)} class="zone" stroke-width={line} stroke-dasharray={one.height ? `${6 * line} ${3 * line}` : undefined} />)}
        {named(now).map(({ x, y, text }) => <Text key={text} x={x} y={y} size={0.024 * side} kind="zone-name">{text}</Text>)}
        <rect class="frame" x={x[0]} y={y[0]} width={x[1] - x[0]} height={y[1] - y[0]} stroke-width={line} />
        <UsualPlaces now={now} line={line} side={side} />
        <Rings now={now} line={line} />
        <Frames now={now} line={line} side={side} />
        <Heat now={now} />
        {lowestFirst(bases.value, now.objects.length).map((k) => {
          const one = now.objects[k], pose = poses.value[k];
          if (!pose) return null;
          const chosen = thing.value === one.name;
          const r = reach(one.footprint);
          const kept = one.name in request.value.fix;
          return (
            <g key={one.name} transform={at(pose)} class={`thing${chosen ? " chosen" : ""}${lit.value === one.name ? " lit" : ""}${one.fixed ? " fixed" : ""}`} onPointerEnter={() => (lit.value = one.name)} onPointerLeave={() => (lit.value = null)} onPointerDown={down(one.name, false)} onDblClick={() => hold(one.name)}>
              <path d={path(one.footprint)} fill={TINTS[k % TINTS.length]} stroke={EDGES[k % EDGES.length]} stroke-width={chosen ? 2.6 * line : 1.5 * line} stroke-dasharray={kept ? `${4 * line} ${2.5 * line}` : undefined} />
              <line x1={0} y1={0} x2={0.8 * r} y2={0} stroke={EDGES[k % EDGES.length]} stroke-width={1.2 * line} />
              {chosen && !one.fixed && movable.value ? <circle cx={1.25 * r + 0.012 * side} cy={0} r={0.016 * side} class="knob" onPointerDown={down(one.name, true)} /> : null}
            </g>
          );
        })}
        <Hands now={now} line={line} />
        <Axes now={now} side={side} />
        {cameraNames(now, side).map(([u, v, text]) => <Text key={text} x={u} y={v} size={0.024 * side} kind="camera-name">{text}</Text>)}
        {nameTags(now, side).map(({ x, y, text, kind, line: lead }) => (
          <g key={text}>
            {lead ? <line x1={lead[0]} y1={-lead[1]} x2={lead[2]} y2={-lead[3]} class="leader" stroke-width={0.7 * line} /> : null}
            <Text x={x} y={-y} size={0.026 * side} kind={`name ${kind}`}>{text}</Text>
          </g>
        ))}
        {trails.value.map(({ index, points }) => <polyline key={index} class="trail" points={points.map(([u, v]) => `${u},${v}`).join(" ")} stroke={EDGES[index % EDGES.length]} stroke-width={1.3 * line} />)}
        {marks.map((mark, k) => <Dimension key={k} mark={mark} side={side} />)}
        {marks.map((mark, k) =>
          mark.kind === "guide" ? null : (
            <Text key={k} x={mark.kind === "line" ? (mark.start[0] + mark.end[0]) / 2 : mark.center[0]} y={(mark.kind === "line" ? (mark.start[1] + mark.end[1]) / 2 : mark.center[1]) + 0.024 * side} size={0.03 * side} kind={`mark-text ${mark.good ? "good" : "bad"}`}>
              {spokenText(mark.text)}
            </Text>
          ),
        )}
      </g>
    </svg>
  );
}
