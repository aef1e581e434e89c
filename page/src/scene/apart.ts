// Where the words over a scene stand. Lengths and angles stand above what they measure. A name stands beside its object:
// at the nearest place that covers neither another object nor other words; where that is not right beside it, or covers
// something, a line leads to the object.

export interface Box {
  x0: number;
  y0: number;
  x1: number;
  y1: number;
}

export interface Tag {
  x: number;
  y: number;
  text: string;
  kind: "name" | "chosen" | "lit" | "good" | "bad" | "axis";
  of?: Box; // of a name: what its object covers of the picture
  line?: [number, number, number, number]; // of a name that stands apart: from the object to the word
}

export interface Letters {
  wide(text: string): number;
  high: number;
  within?: boolean; // a name may stand on its own object, where it fits
}

const NEAR = 3; // between an object and its name, in tenths of the height of a line
const RINGS = 4; // distances at which places are looked for
const FAR = 0.06; // what a place costs for each unit that it is away, of one that is covered
const WORDS = 8; // how much worse it is to cover words than objects
const STACKED = 0.2; // of what an object covers, that lies over or under another one: its name needs a line to be told from theirs
const MOST = 26; // letters of a name; of a longer one the middle is left out

export function shortened(name: string, most = MOST): string {
  const half = Math.floor((most - 1) / 2);
  return name.length <= most ? name : `${name.slice(0, half)}…${name.slice(-half)}`;
}

const named = (tag: Tag) => tag.kind === "name" || tag.kind === "chosen" || tag.kind === "lit";

function shared(a: Box, b: Box): number {
  return Math.max(0, Math.min(a.x1, b.x1) - Math.max(a.x0, b.x0)) * Math.max(0, Math.min(a.y1, b.y1) - Math.max(a.y0, b.y0));
}

/** The words with their places, in the units of `letters`. `objects` are the boxes that must not be covered, `view` what
 * can be seen. */
export function apart(tags: Tag[], objects: Box[], view: Box, letters: Letters): Tag[] {
  const { high } = letters, gap = (NEAR * high) / 10;
  const placed: Box[] = [], found: Tag[] = [];
  const order = (tag: Tag) => (named(tag) ? (tag.kind === "name" ? 2 : 1) : 0);
  for (const tag of [...tags].sort((one, two) => order(one) - order(two))) {
    const half = letters.wide(tag.text) / 2;
    const around = (x: number, y: number): Box => ({ x0: x - half, x1: x + half, y0: y - high / 2, y1: y + high / 2 });
    let best = { x: tag.x, y: tag.y, cost: Infinity, free: true };
    if (!tag.of) best.cost = 0;
    const own = tag.of ?? around(tag.x, tag.y);
    const [cx, cy] = [(own.x0 + own.x1) / 2, (own.y0 + own.y1) / 2];
    const others = objects.filter((one) => one !== tag.of && !(tag.of && one.x0 === own.x0 && one.y0 === own.y0 && one.x1 === own.x1 && one.y1 === own.y1));
    for (let ring = 0; tag.of && ring < RINGS && best.cost > 0; ring++) {
      const far = gap + high / 2 + 1.2 * ring * high;
      const right = own.x1 + gap + half + ring * high, left = own.x0 - gap - half - ring * high;
      const fits = letters.within && ring === 0 && 2 * half < own.x1 - own.x0 && high < own.y1 - own.y0;
      const places: [number, number][] = [...(fits ? [[cx, cy] as [number, number]] : []), [cx, own.y1 + far], [cx, own.y0 - far], [right, cy], [left, cy], [right, own.y1 + far], [left, own.y1 + far], [right, own.y0 - far], [left, own.y0 - far]];
      for (const [x, y] of places) {
        const box = around(x, y), area = 2 * half * high;
        const outside = 1 - shared(box, view) / area;
        const words = placed.reduce((sum, one) => sum + shared(box, one), 0) / area;
        const covers = others.reduce((sum, one) => sum + shared(box, one), 0) / area;
        const cost = WORDS * (outside + words) + covers + FAR * ring;
        if (cost < best.cost - 1e-9) best = { x, y, cost, free: ring === 0 && covers === 0 };
        if (cost === 0) break;
      }
    }
    const box = around(best.x, best.y);
    placed.push(box);
    // the line ends where the word begins
    const toward = (from: number, low: number, high: number) => Math.min(Math.max(from, low), high);
    const stacked = others.some((one) => shared(one, own) > STACKED * (own.x1 - own.x0) * (own.y1 - own.y0));
    const line: Tag["line"] = tag.of && (!best.free || (stacked && (best.x !== cx || best.y !== cy))) ? [cx, cy, toward(cx, box.x0, box.x1), toward(cy, box.y0, box.y1)] : undefined;
    found.push({ ...tag, x: best.x, y: best.y, line });
  }
  return found;
}

let ink: CanvasRenderingContext2D | null = null;
const known = new Map<string, number>();

/** The words of the page over a picture, in pixels. */
export const PIXELS: Letters = {
  high: 19,
  wide(text) {
    let wide = known.get(text);
    if (wide === undefined) {
      ink ??= document.createElement("canvas").getContext("2d")!;
      ink.font = "600 11.5px system-ui, sans-serif";
      wide = ink.measureText(text).width + 14;
      known.set(text, wide);
    }
    return wide;
  },
};
