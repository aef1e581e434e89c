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

export function degrees(theta: number): string {
  return `${Math.round((180 * theta) / Math.PI)}°`;
}

export function round(value: number, digits = 3): number {
  return Number(value.toPrecision(digits));
}
