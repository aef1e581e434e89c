// Flat lines on the table: dimensions, and the ways of objects.
import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, MeshBasicMaterial } from "three";
import type { Point } from "../types";

export function dashes(start: Point, end: Point, step: number): [Point, Point][] {
  const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
  const count = Math.max(1, Math.min(200, Math.round(length / step)));
  const at = (share: number): Point => [start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])];
  return Array.from({ length: count }, (_, k): [Point, Point] => [at(k / count), at((k + 0.55) / count)]);
}

/** Flat lines of a width, drawn over everything. */
export function ribbon(segments: [Point, Point][], width: number, color: number, z: number): Mesh {
  const points: number[] = [];
  for (const [[ax, ay], [bx, by]] of segments) {
    const length = Math.hypot(bx - ax, by - ay) || 1e-9;
    const nx = ((ay - by) / length) * (width / 2), ny = ((bx - ax) / length) * (width / 2);
    points.push(ax + nx, ay + ny, z, ax - nx, ay - ny, z, bx + nx, by + ny, z, bx + nx, by + ny, z, ax - nx, ay - ny, z, bx - nx, by - ny, z);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  const mesh = new Mesh(geometry, new MeshBasicMaterial({ color, side: DoubleSide, depthTest: false, transparent: true }));
  mesh.renderOrder = 10;
  return mesh;
}
