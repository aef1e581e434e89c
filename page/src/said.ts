// What a part of a formula says: as the text has it, and in words.
import { rarity, spec, text } from "./state";
import type { Decides, Line } from "./types";
import { measure, percent, spoken } from "./words";

type Part = Pick<Line, "text" | "spans"> & { unit?: string };

const CONSTANT = /^([\d.]+\s*(mm|cm|m|deg|rad|turn)?|[A-Z][A-Z0-9_]*)$/;
const NUMBER = /^-?[\d.]+(e-?\d+)?$/;
const COMPARES = /[<>]=?|==/;
const TOKEN = /[A-Za-z_]\w*(?:\.\w+)*(?:\[[^\]]*\])?|\d+(?:\.\d+)?(?:\s*(?:mm|cm|m|deg|rad|turn)\b)?|\s+|./gs;
const LONGEST = 200; // characters of a source that is compared

/** Where a part is written, innermost: a relation's use, or a comparison in a definition. */
function sourceOf({ spans }: Part, at = 0): string {
  return spans.length ? [...text.value].slice(...spans[at]).join("").replace(/\s+/g, " ") : "";
}

/** A part of a formula as the spec has it: with `20 deg` and not 0.349066, with heights by their names. */
export function asWritten(line: Part): string {
  const not = line.text.startsWith("!") ? "!" : "";
  const body = line.text.slice(not.length), source = sourceOf(line);
  const mine = call(body);
  const theirs = mine && line.spans.map((_, at) => call(sourceOf(line, at))).find((one) => one?.name === mine.name && one.args.length <= mine.args.length);
  if (mine && theirs) {
    const last = mine.args.length - 1;
    const args = mine.args.map((arg, k) => (!NUMBER.test(arg) ? arg : k < theirs.args.length && CONSTANT.test(theirs.args[k]) ? theirs.args[k] : k === last && line.unit ? spoken(Number(arg), line.unit) : arg));
    return `${not}${mine.name}(${args.join(", ")})`;
  }
  if (COMPARES.test(source)) {
    const meant = filled(source, body.replace(/^\((.*)\)$/s, "$1"));
    if (meant) return not ? `!(${meant})` : meant;
  } else if (source && (/\d or \d|\d\.\.\d/.test(body) || !/[a-z]\w*\(/i.test(body))) return `${source}: heights`; // of a relation that is many comparisons
  return line.text.replace(/([<>]=?) (-?[\d.]+)\)?$/, (whole, sign, value) => (line.unit && value !== "0" ? `${sign} ${spoken(Number(value), line.unit)}${whole.endsWith(")") ? ")" : ""}` : whole));
}

/** The name and the arguments of a plain call. */
function call(written: string): { name: string; args: string[] } | null {
  const found = written.match(/^(\w+)\((.*)\)$/s);
  const args = [""];
  let deep = 0;
  for (const one of found?.[2] ?? "") {
    if ("([".includes(one)) deep++;
    if (")]".includes(one) && --deep < 0) return null; // the last bracket is not that of the first
    if (one === "," && !deep) args.push("");
    else args[args.length - 1] += one;
  }
  return found && { name: found[1], args: args.map((one) => one.trim().replace(/^\w+ = /, "")) };
}

/** A comparison as it is written, with objects for the variables of `forall` and of definitions. Null where what stands
 * for them cannot be told from `body`, the comparison as it was compiled. */
function filled(source: string, body: string): string | null {
  if (source.length > LONGEST) return null;
  const now = spec.value!;
  const named = new Set(["workspace", "objects", ...now.objects.flatMap(({ name }) => [name, name.split("[")[0]]), ...now.regions.flatMap(({ name }) => [name, name.split("[")[0]])]);
  const tokens = source.match(TOKEN)!;
  const variable = (token: string, k: number) => {
    if (!/^[a-z_]/i.test(token) || tokens[k + 1] === "(" || /^[A-Z][A-Z0-9_]*$/.test(token) || /^(and|or|not)$/.test(token)) return false;
    const [, base, index] = token.match(/^([\w.]+?)(?:\[(.*)\])?$/) ?? [];
    return base !== undefined && (index === undefined ? !named.has(base) : !/^\d+$/.test(index));
  };
  if (!tokens.some(variable)) return source;
  const groups: string[] = [];
  const pattern = tokens.map((token, k) => {
    if (variable(token, k)) {
      const known = groups.indexOf(token);
      if (known >= 0) return `\\${known + 1}`;
      groups.push(token);
      return "([\\w.]+(?:\\[\\w+\\])?)";
    }
    if (/^\d/.test(token) || /^[A-Z][A-Z0-9_]*$/.test(token)) return "-?[\\d.]+(?:e-?\\d+)?";
    return /^\s+$/.test(token) ? "\\s*" : token.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
  });
  const found = body.match(new RegExp(`^${pattern.join("")}$`));
  if (found) return tokens.map((token, k) => (variable(token, k) ? found[groups.indexOf(token) + 1] : token)).join("");
  return /\d or \d/.test(body) ? source : null;
}

// ---- in words

// What is so where the margin of a relation is 0 or more, and where it is less; of one whose margin is the tolerance
// itself, the third. a b c: what it is about; m: the margin; e: the tolerance; d: what is measured.
const FACTS: Record<string, [string, string, string?]> = {
  leftOf: ["a is m left of b", "a is m right of b"],
  rightOf: ["a is m right of b", "a is m left of b"],
  belowOf: ["a is m in front of b", "a is m behind b"],
  aboveOf: ["a is m behind b", "a is m in front of b"],
  closeTo: ["a is d from b, m less than e", "a is d from b, m more than e"],
  closerThan: ["a is m nearer to b than to c", "a is m nearer to c than to b"],
  between: ["by way of a it is d longer from b to c, m less than e", "by way of a it is d longer from b to c, m more than e"],
  alignedX: ["a and b are d off in x, m less than e", "a and b are d off in x, m more than e"],
  alignedY: ["a and b are d off in y, m less than e", "a and b are d off in y, m more than e"],
  angle: ["a is turned d from b, m less than e", "a is turned d from b, m more than e"],
  facing: ["a points d past b, m less than e", "a points d past b, m more than e"],
  sameHeading: ["a and b are turned d apart, m less than e", "a and b are turned d apart, m more than e"],
  fullyLeftOf: ["the right edge of a is m left of b", "the right edge of a is m right of the left edge of b"],
  fullyRightOf: ["the left edge of a is m right of b", "the left edge of a is m left of the right edge of b"],
  fullyBelowOf: ["the back edge of a is m in front of b", "the back edge of a is m behind the front edge of b"],
  fullyAboveOf: ["the front edge of a is m behind b", "the front edge of a is m in front of the back edge of b"],
  partlyLeftOf: ["a reaches m further left than b", "a reaches m less far left than b"],
  partlyRightOf: ["a reaches m further right than b", "a reaches m less far right than b"],
  partlyBelowOf: ["a reaches m further to the front than b", "a reaches m less far to the front than b"],
  partlyAboveOf: ["a reaches m further back than b", "a reaches m less far back than b"],
  apart: ["a and b are m apart", "a and b overlap by m"],
  overlaps: ["a and b overlap by m", "a and b are m apart"],
  touching: ["a and b are d off touching, m less than e", "a and b are d off touching, m more than e"],
  inside: ["a lies m inside b", "a sticks out of b by m"],
  on: ["the centre of a is m inside b", "the centre of a is m outside b"],
  nearEdge: ["a is d off the border of b, m less than e", "a is d off the border of b, m more than e"],
  reachable: ["a is m inside what b reaches", "a is m outside of what b reaches"],
  atLevel: ["a and b stand d apart in height, m less than e", "a and b stand d apart in height, m more than e", "a and b stand equally high"],
};
const OPPOSITE: Record<string, string> = { farFrom: "closeTo" }; // the same, the other way round
const SAME: Record<string, string> = { "dist <=": "closeTo", "dist >=": "farFrom", "room >=": "inside" };
const EXACT = 1e-9;

/** Of hands and of shares that cameras see, `inner` the margin. */
function sightFact(body: string, inner: number): string | null {
  const hand = body.match(/^handRoom\((.+), (.+), ([\d.]+) deg\) >= 0$/);
  if (hand) return inner >= 0 ? `the hand of ${hand[2]} has ${spoken(inner, "m")} of room around ${hand[1]}, turned by ${hand[3]} deg` : `the hand of ${hand[2]} lacks ${spoken(-inner, "m")} of room around ${hand[1]}, turned by ${hand[3]} deg`;
  const seen = body.match(/^([\d.]+) \* visibleShare\((.+), (.+)\) ([<>])= (-?[\d.]+)$/);
  if (!seen) return null;
  return `${seen[3]} sees ${percent((Number(seen[5]) + (seen[4] === ">" ? inner : -inner)) / Number(seen[1]))} of ${seen[2]}`;
}

/** What decides phi in a scene, in words: `mug is 2 cm left of plate`. Null for what the table has no words for. */
function fact(one: Decides): string | null {
  const written = asWritten(one);
  let not = written.startsWith("!");
  const body = not ? written.slice(1) : written;
  const sight = sightFact(not ? one.text.slice(1).replace(/^\((.*)\)$/s, "$1") : one.text, not ? -one.value : one.value);
  if (sight) return sight;
  let { name, args } = call(body) ?? { name: "", args: [] };
  const compared = body.match(/^(dist|room|gap)\((\w[\w.[\]]*), (\w[\w.[\]]*)\) ([<>]=?) ([^()]+)$/);
  if (compared) [name, args] = [SAME[`${compared[1]} ${compared[4]}`] ?? "", compared.slice(2, 4).concat(compared[5])];
  if (compared?.[1] === "gap" && /^(gap\(\w|noOverlap\(|noCollision\()/.test(sourceOf(one)) && compared[4] === ">=") name = "apart";
  if (name === "clearOf") name = "apart";
  if (name === "inside" && compared && measure(args[2]) !== 0) return null;
  const opposite = OPPOSITE[name];
  if (opposite) [name, not] = [opposite, !not];
  const words = FACTS[name];
  if (!words || args.slice(0, 2).some((arg) => !/^([\w.[\]]+( deg| rad)?|\([^()]*\))$/.test(arg))) return null;
  const inner = not ? -one.value : one.value; // the margin of the relation itself
  const tolerance = measure(args[args.length - 1]) ?? 0;
  const say = (value: number) => spoken(Math.abs(value), one.unit);
  const values: Record<string, string> = { a: args[0], b: args[1], c: args[2] ?? "", m: say(inner), e: spoken(tolerance, one.unit), d: say(Math.max(tolerance - inner, 0)) };
  let template = words[inner >= 0 ? 0 : 1];
  if (words[2] && Math.abs(tolerance - inner) < EXACT) template = words[2];
  if (name === "apart" && tolerance > 0) {
    values.d = say(tolerance + inner);
    template = `a and b ${tolerance + inner >= 0 ? "are d apart" : "overlap by d"}, ${inner >= 0 ? "m more" : "m less"} than e`;
    if (tolerance + inner < 0) template = "a and b overlap by d, and should be e apart";
  }
  return template.replace(/\b[abcmed]\b/g, (key) => values[key]);
}

/** What decides phi in a scene, in words, or as it is written and by how much it holds. */
export function inWords(one: Decides): { words: string; code: string } {
  const found = fact(one);
  if (found) return { words: found, code: "" };
  const source = sourceOf(one);
  const code = COMPARES.test(source) || !source ? asWritten(one) : `${one.text.startsWith("!") ? "!" : ""}${source}`;
  return { words: `${one.value >= 0 ? "holds by" : "fails by"} ${spoken(Math.abs(one.value), one.unit)}`, code };
}

const NEAR = 0.1, CLEAR = 0.5; // shares of what phi can reach on its side of 0

/** How well a phi satisfies a label, of all that occurs. */
export function grade(phi: number, of: string): string {
  const low = rarity.value[of]?.reached[0] ?? spec.value?.labels.find((one) => one.name === of)?.bounds[0] ?? -1;
  const high = rarity.value[of]?.reached[1] ?? spec.value?.labels.find((one) => one.name === of)?.bounds[1] ?? 1;
  if (phi >= 0) return phi > 0 && phi >= high * 0.999 ? "fully satisfied" : phi <= NEAR * high ? "just satisfied" : phi >= CLEAR * high ? "clearly satisfied" : "satisfied";
  return phi >= NEAR * low ? "just fails" : phi <= CLEAR * low ? "clearly fails" : "fails";
}
