// Where the words over a scene stand: a name that would cover another word, or be covered by one, moves down.
import type { Tag } from "./table3d";

const HIGH = 20; // pixels of one word with its edge
const LETTER = 7;
const EDGE = 14;
const MOST = 4; // places that are tried

const name = (tag: Tag) => tag.kind === "name" || tag.kind === "chosen";
const wide = (tag: Tag) => tag.text.length * LETTER + EDGE;

/** The words with their places on the screen: lengths and angles above what they measure, names below the objects. */
export function apart(tags: Tag[]): Tag[] {
  const placed: Tag[] = [];
  const covered = (one: Tag) => placed.find((two) => Math.abs(one.x - two.x) < (wide(one) + wide(two)) / 2 && Math.abs(one.y - two.y) < HIGH);
  for (const tag of [...tags].sort((one, two) => Number(name(one)) - Number(name(two)))) {
    const one = { ...tag, y: name(tag) ? tag.y + 10 : tag.y - 20 };
    if (name(tag))
      for (let k = 0, two = covered(one); two && k < MOST; k++, two = covered(one)) one.y = two.y + HIGH;
    placed.push(one);
  }
  return placed;
}
