// The wood of the table as a texture: planks along x with grain of smooth noise, and the workspace's edge as an inlay.
import { CanvasTexture, LinearMipmapLinearFilter, SRGBColorSpace } from "three";
import type { Spec } from "../types";

const TABLE = 256;
const PLANKS = 6;

let grain: Float32Array | null = null;

/** Smooth noise along one row. */
function noise(table: Float32Array, v: number): (u: number) => number {
  const iv = Math.floor(v), near = (iv & 255) * TABLE, far = ((iv + 1) & 255) * TABLE;
  let fv = v - iv;
  fv = fv * fv * (3 - 2 * fv);
  return (u) => {
    const iu = Math.floor(u), left = iu & 255, right = (iu + 1) & 255;
    let fu = u - iu;
    fu = fu * fu * (3 - 2 * fu);
    const below = table[near + left] + fu * (table[near + right] - table[near + left]);
    return below + fv * (table[far + left] + fu * (table[far + right] - table[far + left]) - below);
  };
}

function chances(): Float32Array {
  const out = new Float32Array(TABLE * TABLE);
  let state = 0x2545f491;
  for (let at = 0; at < out.length; at++) {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    out[at] = (state >>> 0) / 4294967296;
  }
  return out;
}

const made = new Map<string, HTMLCanvasElement>(); // wood without regions: most specs have the same table
const KEPT = 6;

export function woodTexture(spec: Spec, size: number): CanvasTexture {
  const key = JSON.stringify([spec.table, spec.workspace, size]);
  const plain = made.get(key) ?? plainWood(spec, size);
  made.delete(key);
  made.set(key, plain);
  if (made.size > KEPT) made.delete(made.keys().next().value!);
  const canvas = document.createElement("canvas");
  canvas.width = plain.width;
  canvas.height = plain.height;
  const context = canvas.getContext("2d")!;
  context.drawImage(plain, 0, 0);
  drawRegions(context, spec, canvas.width, canvas.height);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 4;
  texture.minFilter = LinearMipmapLinearFilter;
  return texture;
}

function plainWood(spec: Spec, size: number): HTMLCanvasElement {
  const [x0, y0, x1, y1] = spec.table;
  const [u0, u1] = spec.workspace.x;
  const [v0, v1] = spec.workspace.y;
  const side = Math.max(u1 - u0, v1 - v0);
  const width = x1 - x0 >= y1 - y0 ? size : Math.max(64, Math.round((size * (x1 - x0)) / (y1 - y0)));
  const height = x1 - x0 >= y1 - y0 ? Math.max(64, Math.round((size * (y1 - y0)) / (x1 - x0))) : size;
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(width, height), { data } = image;
  const table = (grain ??= chances());
  const pixel = Math.max((x1 - x0) / width, (y1 - y0) / height) / side;
  const inlay = Math.max(0.0022, 0.8 * pixel), seam = Math.max(0.0016, 0.7 * pixel);
  for (let row = 0; row < height; row++) {
    const y = y1 - ((row + 0.5) * (y1 - y0)) / height;
    const lane = ((y - v0) / side) * PLANKS;
    const number = Math.floor(lane);
    const chance = table[number & 255];
    const v = lane - number + 5 * number;
    const toSeam = Math.abs(lane - Math.round(lane)) / PLANKS;
    const seamline = 0.14 * Math.max(0, Math.min(1, 1.5 - toSeam / seam));
    const wide = noise(table, 1.1 * v), fine = noise(table, 3 * v), flecks = noise(table, 46 * v), pores = noise(table, 88 * v);
    for (let column = 0; column < width; column++) {
      const x = x0 + ((column + 0.5) * (x1 - x0)) / width;
      const u = x / side + 9 * chance;
      const rings = 1.7 * v + 1.5 * wide(1.3 * u) + 0.35 * fine(3.7 * u);
      const streaks = 0.5 + 0.5 * Math.sin(2 * Math.PI * 2.6 * rings);
      const pore = pores(26 * u) ** 2;
      const dark = 0.065 * (chance - 0.5) + 0.06 * (streaks * streaks - 0.4) + 0.07 * (flecks(11 * u) - 0.5) + 0.2 * pore * pore * pore;
      const outside = Math.max(u0 - x, x - u1, v0 - y, y - v1) / side;
      let line = seamline;
      line += outside > 0 ? 0.035 : 0;
      line += 0.26 * Math.max(0, Math.min(1, 1.5 - Math.abs(outside) / inlay));
      const at = 4 * (row * width + column);
      data[at] = 255 * 0.86 * (1 - dark * 0.35 - line * 0.8);
      data[at + 1] = 255 * 0.74 * (1 - dark - line);
      data[at + 2] = 255 * 0.585 * (1 - dark * 1.75 - line * 1.1);
      data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** Regions are cloths in pale colours, drawn into the wood. */
function drawRegions(context: CanvasRenderingContext2D, spec: Spec, width: number, height: number): void {
  const [x0, y0, x1, y1] = spec.table;
  for (const region of spec.regions) {
    if (region.height) continue; // a board, which is a body of its own
    context.save();
    context.setTransform(width / (x1 - x0), 0, 0, -height / (y1 - y0), (-x0 * width) / (x1 - x0), (y1 * height) / (y1 - y0));
    context.translate(region.pose[0], region.pose[1]);
    context.rotate(region.pose[2]);
    context.beginPath();
    if (region.footprint.kind === "circle") context.arc(0, 0, region.footprint.radius!, 0, 7);
    else region.footprint.corners!.forEach(([x, y], at) => (at ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    const [r, g, b] = region.color.map((one) => Math.round(255 * one));
    context.fillStyle = `rgba(${r},${g},${b},0.62)`;
    context.fill();
    context.lineWidth = 0.004;
    context.strokeStyle = `rgba(${Math.round(r * 0.6)},${Math.round(g * 0.6)},${Math.round(b * 0.6)},0.7)`;
    context.stroke();
    context.restore();
  }
}
