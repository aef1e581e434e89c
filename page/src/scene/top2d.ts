// A scene from above on a canvas: for small pictures where there is no WebGL, or where top views are wanted.
import type { Footprint, Pose, Spec } from "../types";

export const TINTS = ["#cfe0f3", "#f8dcc9", "#d3ead6", "#e5d8ee", "#f7eab8", "#cbe8ea"];
export const EDGES = ["#4a76a6", "#b9713f", "#56905f", "#8568a0", "#a3882a", "#46919a"];

export function outline(context: CanvasRenderingContext2D, footprint: Footprint, [x, y, theta]: Pose): void {
  context.beginPath();
  if (footprint.kind === "circle") context.arc(x, y, footprint.radius!, 0, 7);
  else {
    const cos = Math.cos(theta), sin = Math.sin(theta);
    footprint.corners!.forEach(([u, v], at) => {
      const point: [number, number] = [x + cos * u - sin * v, y + sin * u + cos * v];
      if (at) context.lineTo(...point);
      else context.moveTo(...point);
    });
  }
  context.closePath();
}

/** Where a group of SVG stands that is drawn in the frame of a pose. */
export const at = ([x, y, theta]: Pose) => `translate(${x} ${y}) rotate(${(180 * theta) / Math.PI})`;

const LIGHT = { paper: "#fbfaf6", zone: "#efece0", edge: "#b4b4b0", alpha: 1 };
const DARK = { paper: "#20242a", zone: "#2a3037", edge: "#515964", alpha: 0.3 };

/** The objects' numbers in the order in which they are drawn from above: what stands lowest first. */
export function lowestFirst(bases: number[], count: number): number[] {
  return Array.from({ length: count }, (_, k) => k).sort((a, b) => (bases[a] ?? 0) - (bases[b] ?? 0) || a - b);
}

/** How the table lies in a picture of a size: x is scale * x + left, y is top - scale * y. */
export function topScale({ table: [x0, y0, x1, y1] }: Spec, width: number, height: number): { scale: number; left: number; top: number } {
  const scale = Math.min(width / (x1 - x0), height / (y1 - y0));
  return { scale, left: width / 2 - (scale * (x0 + x1)) / 2, top: height / 2 + (scale * (y0 + y1)) / 2 };
}

export function drawTop(context: CanvasRenderingContext2D, spec: Spec, poses: Pose[], bases: number[]): void {
  const look = document.documentElement.dataset.theme === "dark" ? DARK : LIGHT;
  const { width, height } = context.canvas;
  const { scale, left, top } = topScale(spec, width, height);
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, width, height);
  context.setTransform(scale, 0, 0, -scale, left, top);
  const { x, y } = spec.workspace;
  context.fillStyle = look.paper;
  context.fillRect(x[0], y[0], x[1] - x[0], y[1] - y[0]);
  context.lineWidth = 1 / scale;
  for (const region of spec.regions) {
    outline(context, region.footprint, region.pose);
    context.fillStyle = look.zone;
    context.fill();
  }
  context.strokeStyle = look.edge;
  context.strokeRect(x[0], y[0], x[1] - x[0], y[1] - y[0]);
  for (const at of lowestFirst(bases, spec.objects.length)) {
    const thing = spec.objects[at], pose = poses[at];
    if (!pose) continue;
    outline(context, thing.footprint, pose);
    context.fillStyle = TINTS[at % TINTS.length];
    context.globalAlpha = look.alpha;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = EDGES[at % EDGES.length];
    context.lineWidth = 1.5 / scale;
    context.stroke();
  }
}
