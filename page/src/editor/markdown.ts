// The little Markdown that hover texts use, as elements: no HTML is ever taken from a text.
export function markdown(value: string): HTMLElement {
  const out = document.createElement("div");
  for (const part of value.split(/\n\n+/)) {
    const fence = part.match(/^```\w*\n([\s\S]*?)\n?```$/);
    if (fence) {
      const pre = document.createElement("pre");
      pre.textContent = fence[1];
      out.append(pre);
      continue;
    }
    const p = document.createElement("p");
    for (const piece of part.split(/(`[^`]*`|\*\*[^*]*\*\*|\*[^*]+\*)/)) {
      if (!piece) continue;
      const kind = piece.startsWith("`") ? "code" : piece.startsWith("**") ? "strong" : piece.startsWith("*") && piece.length > 2 ? "em" : null;
      if (!kind) p.append(piece);
      else {
        const one = document.createElement(kind);
        one.textContent = piece.replace(/^(`|\*\*|\*)|(`|\*\*|\*)$/g, "");
        p.append(one);
      }
    }
    out.append(p);
  }
  return out;
}
