// What a code means: the text of `scenegen explain`.
import type { ComponentChildren } from "preact";
import { closeCode, explainCode, explained, leaveCode } from "../reader";

let soon: ReturnType<typeof setTimeout> | undefined;
const PAUSE = 200; // ms that the pointer must rest on a code

export function Code({ code }: { code: string }) {
  return (
    <button class="diagnostic-code" title="what this means" aria-haspopup="dialog" onClick={() => { clearTimeout(soon); void explainCode(code, true); }}
      onMouseEnter={() => (soon = setTimeout(() => void explainCode(code, false), PAUSE))}
      onMouseLeave={() => { clearTimeout(soon); leaveCode(); }}>{code}</button>
  );
}

export function Explain() {
  const one = explained.value;
  if (!one) return null;
  return (
    <div class="explained" role="dialog" aria-label={`what ${one.code} means`}>
      <header role="presentation"><b class={one.severity === "warning" ? "warn" : "bad"}>{one.severity}</b> <code>{one.code}</code>{one.pinned ? <button onClick={closeCode}>close <kbd>Esc</kbd></button> : null}</header>
      {one.means.split(/\n\n+/).map((part, k) => <p key={k}>{ticked(part)}</p>)}
      {one.example ? <><h2>Example</h2><pre>{one.example}</pre></> : null}
      {one.mended ? <><h2>Corrected</h2><pre class="mended">{one.mended}</pre></> : null}
    </div>
  );
}

export function ticked(text: string): ComponentChildren {
  return text.split(/(`[^`]*`)/).map((piece, k) => (piece.startsWith("`") ? <code key={k}>{piece.slice(1, -1)}</code> : piece));
}
