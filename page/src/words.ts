// Numbers as people read them.
export function number(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return "–";
  const text = Math.abs(value) < 1e-12 ? "0" : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-4 ? value.toExponential(1) : String(Number(value.toPrecision(digits)));
  return text.replace("-", "−");
}

export function signed(value: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;
}

/** `1 in 38 million` for log10 of a probability. */
export function oneIn(log: number, what = "scenes"): string {
  if (log > -0.31) return 10 ** log > 0.995 ? `almost all ${what}` : `${Math.round(100 * 10 ** log)} % of ${what}`;
  const count = 10 ** -log;
  for (const [size, word] of [[1e12, ""], [1e9, " billion"], [1e6, " million"], [1e3, ",000"]] as [number, string][]) {
    if (count < size) continue;
    if (size === 1e12) return `1 in 10^${(-log).toFixed(0)}`;
    const some = count / size;
    if (size === 1e3) return `1 in ${(Math.round(count / (some < 10 ? 100 : 1000)) * (some < 10 ? 100 : 1000)).toLocaleString("en-US")}`;
    return `1 in ${some < 10 ? some.toFixed(1) : Math.round(some)}${word}`;
  }
  return `1 in ${count < 10 ? count.toFixed(1) : Math.round(count)}`;
}

const UNITS: Record<string, number> = { "": 1, m: 1, cm: 0.01, mm: 0.001, rad: 1, deg: Math.PI / 180, turn: 2 * Math.PI };

/** A length or an angle as the language writes them, in metres or radians; null where it is none. */
export function measure(text: string): number | null {
  const found = text.trim().replace("−", "-").match(/^([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(\w*)$/i);
  const value = found && found[2] in UNITS ? Number((Number(found[1]) * UNITS[found[2]]).toPrecision(12)) : NaN;
  return Number.isFinite(value) ? value : null;
}

/** A length or an angle as people say it: 2 cm, 3 mm, 5 deg; other numbers as they are. */
export function spoken(value: number, unit: string): string {
  const size = Math.abs(value), sign = value < 0 ? "−" : "";
  const plain = (one: number, most: number) => `${sign}${Number(one.toFixed(one >= most ? 0 : 1))}`;
  if (unit === "rad") return `${plain((size * 180) / Math.PI, 10)} deg`;
  if (unit !== "m" && unit !== "m/s") return `${number(value)}${unit && ` ${unit}`}`;
  const per = unit === "m" ? "" : "/s";
  if (size >= 0.9995) return `${sign}${Number(size.toFixed(2))} m${per}`;
  if (size >= 0.00995) return `${plain(100 * size, 20)} cm${per}`;
  return size > 0 && size < 0.00005 ? `less than 0.1 mm${per}` : `${plain(1000 * size, 10)} mm${per}`;
}

/** A measured value as a formula has it, `0.025 m`, as people say it. */
export function spokenText(text: string): string {
  const found = text.match(/^(−?)([\d.]+) (m|rad)$/);
  return found ? found[1] + spoken(Number(found[2]), found[3]) : text;
}

/** The round number, of 1, 2 and 5 with zeros, that is nearest to a number. */
export function round125(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const near = [1, 2, 5, 10].map((one) => one * power);
  return near.reduce((best, one) => (Math.abs(Math.log(one / value)) < Math.abs(Math.log(best / value)) ? one : best));
}

/** A share in per cent; 0 and 100 are only what is exactly that. */
export function percent(share: number): string {
  return `${share <= 0 ? 0 : share >= 1 ? 100 : Math.min(Math.max(Math.round(100 * share), 1), 99)} %`;
}

export function degrees(theta: number): string {
  return `${Math.round((180 * theta) / Math.PI)}°`;
}

export function round(value: number, digits = 3): number {
  return Number(value.toPrecision(digits));
}
