// Meshes as the server packs them, as geometries; a plain block until they are there.
import { BufferAttribute, BufferGeometry, ExtrudeGeometry, CylinderGeometry, Shape } from "three";
import type { Footprint, PackedMesh, Thing } from "../types";

const made = new Map<string, BufferGeometry>();

function bytes(text: string): ArrayBuffer {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let at = 0; at < raw.length; at++) out[at] = raw.charCodeAt(at);
  return out.buffer;
}

export function geometryOf(thing: Thing, packed: PackedMesh | undefined): BufferGeometry {
  const key = packed ? thing.mesh : `block ${thing.mesh}`;
  let found = made.get(key);
  if (!found) {
    found = packed ? unpacked(packed) : block(thing);
    found.computeBoundingSphere();
    made.set(key, found);
  }
  return found;
}

function unpacked(packed: PackedMesh): BufferGeometry {
  const steps = new Int16Array(bytes(packed.position));
  const position = new Float32Array(steps.length);
  for (let at = 0; at < steps.length; at++) position[at] = steps[at] * packed.scale;
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setAttribute("normal", new BufferAttribute(new Int8Array(bytes(packed.normal)), 3, true));
  const color = new Uint8Array(bytes(packed.color));
  const linear = new Float32Array(color.length);
  for (let at = 0; at < color.length; at++) {
    const one = color[at] / 255;
    linear[at] = one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4;
  }
  geometry.setAttribute("color", new BufferAttribute(linear, 3));
  const index = packed.wide ? new Uint32Array(bytes(packed.index)) : new Uint16Array(bytes(packed.index));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

/** An upright prism over a footprint, from 0 to a height. */
export function prism(footprint: Footprint, height: number): BufferGeometry {
  if (footprint.kind === "circle")
    return new CylinderGeometry(footprint.radius!, footprint.radius!, height, 48).rotateX(Math.PI / 2).translate(0, 0, height / 2);
  const shape = new Shape();
  footprint.corners!.forEach(([x, y], at) => (at ? shape.lineTo(x, y) : shape.moveTo(x, y)));
  return new ExtrudeGeometry(shape, { depth: height, bevelEnabled: false });
}

function block(thing: Thing): BufferGeometry {
  const geometry = prism(thing.footprint, thing.height);
  const count = geometry.getAttribute("position").count;
  const color = new Float32Array(3 * count);
  for (let at = 0; at < count; at++) color.set(thing.color.map((one) => one ** 2.2), 3 * at);
  geometry.setAttribute("color", new BufferAttribute(color, 3));
  return geometry;
}
