// Sizes of footprints, in metres.
import type { Footprint, Point } from "../types";

/** How far the outermost point is from the centre. */
export function reach(footprint: Footprint): number {
  return footprint.radius ?? Math.max(...footprint.corners!.map(([x, y]) => Math.hypot(x, y)));
}

/** Points round a footprint. */
export function outline(footprint: Footprint): Point[] {
  const around = (k: number): Point => [footprint.radius! * Math.cos((k * Math.PI) / 4), footprint.radius! * Math.sin((k * Math.PI) / 4)];
  return footprint.corners ?? Array.from({ length: 8 }, (_, k) => around(k));
}
