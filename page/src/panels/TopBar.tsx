// The bar at the top: the file, the scenes as files, the look.
import { signal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { before, command } from "../command";
import { format, waitingTexts } from "../editor/editor";
import { download, fileName, handMoved, list, openFile, openText, openWaiting, save, type Listing } from "../files";
import { focusBack } from "../focus";
import { connected } from "../server";
import { link } from "../share";
import { alone, boot, busy, help, layout, message, preview, result, saved, scenes, shown, spec, unsaved, wrong } from "../state";
import { theme, toggleTheme } from "../theme";
import { ticked } from "./Explain";
import { welcome } from "./Welcome";

export const menu = signal<"" | "file" | "take" | "save">("");
const listing = signal<Listing | null>(null);
const wanted = signal("");

let opener: Element | null = null; // what had the focus before

export function openMenu(which: "file" | "take" | "save"): void {
  if (!menu.value) opener = document.activeElement;
  menu.value = menu.value === which ? "" : which;
  if (menu.value === "file") void list().then((found) => (listing.value = found), (error) => (message.value = error.message));
  if (menu.value === "save") wanted.value = saved.value.path ?? fileName(saved.value.name);
}

function toggleGrid(): void {
  layout.value = layout.value === "many" ? "one" : "many";
}

export async function saveOrAsk(): Promise<void> {
  if (!saved.value.path) openMenu("save");
  else await save();
}

export function TopBar() {
  const bar = useRef<HTMLElement>(null);
  useEffect(() => {
    const away = (event: PointerEvent) => {
      if (menu.value && !bar.current!.contains(event.target as Node)) menu.value = "";
    };
    addEventListener("pointerdown", away);
    return () => removeEventListener("pointerdown", away);
  }, []);
  return (
    <header class="bar" ref={bar} inert={help.value}>
      <span class="brand"><svg viewBox="0 0 32 32" aria-hidden="true"><rect width="32" height="32" rx="7" fill="#b98a5b" /><path d="M0 21h32M0 11h32" stroke="#a2744a" stroke-width="1.2" /><circle cx="12" cy="18" r="7" fill="#f4f1ea" /><circle cx="12" cy="18" r="4.2" fill="none" stroke="#d8d2c4" /><rect x="21" y="7" width="6" height="13" rx="1.6" fill="#0b7a5c" transform="rotate(14 24 13)" /></svg><h1>scenegen</h1></span>
      {alone ? <span class="file-name">{boot.name}</span> : (
        <button class="file-name" aria-haspopup="menu" aria-expanded={menu.value === "file"} onClick={() => openMenu("file")} title="open a spec (o)">
          {saved.value.path ?? saved.value.name}{unsaved.value ? <i title="not saved"> •</i> : null} <span aria-hidden="true">▾</span>
        </button>
      )}
      {alone ? null : (
        <span class="buttons wide">
          <button onClick={() => void saveOrAsk()} title="save (Ctrl+S)" disabled={!unsaved.value && !!saved.value.path}>Save</button>
          <button onClick={() => void format()} title="format (Shift+Alt+F)">Format</button>
        </span>
      )}
      <Status />
      <span class="buttons">
        <button class={alone ? "" : "wide"} aria-pressed={layout.value === "many"} onClick={toggleGrid} title="many scenes or one (g)">{layout.value === "many" ? "One" : "Grid"}</button>
        <button aria-haspopup="menu" aria-expanded={menu.value === "take"} onClick={() => openMenu("take")} title="download, command, link (k)">Download ▾</button>
        <button class="icon" onClick={toggleTheme} aria-label={theme.value === "dark" ? "light colours" : "dark colours"} title="light or dark (t)">{theme.value === "dark" ? "☀" : "☾"}</button>
        <button class="icon" onClick={() => (help.value = !help.value)} aria-label="keys" title="keys (?)">?</button>
      </span>
      {menu.value === "file" ? <FileMenu /> : null}
      {menu.value === "take" ? <TakeMenu /> : null}
      {menu.value === "save" ? <SaveMenu /> : null}
    </header>
  );
}

const PASSING = /^(downloaded|saved) |copied$|^stopped$/; // of a deed that is done: after a while what is shown counts again
const PASSES = 6000; // ms

function Status() {
  const found = result.value;
  useEffect(() => {
    const said = message.value;
    if (!PASSING.test(said)) return;
    const timer = setTimeout(() => message.value === said && (message.value = ""), PASSES);
    return () => clearTimeout(timer);
  }, [message.value]);
  let words = message.value;
  if (busy.value === "sample") words = preview.value ? "a first look…" : "sampling…";
  else if (found && (words === "" || /^\d+ (scenes|motions)/.test(words))) {
    words = `${shown.value.length} ${found.motions ? "motion" : "scene"}${shown.value.length === 1 ? "" : "s"}${found.took ? ` · ${found.took < 0.095 ? Math.round(1000 * found.took) + " ms" : found.took.toFixed(1) + " s"}` : ""}`;
  }
  if (wrong.value) words = "the spec has a mistake";
  if (connected.value === "lost") words = "the server is gone";
  if (connected.value === "other") words = "another server is here now";
  if (connected.value === "full") words = "this server allows no more open pages: close another one";
  return <span class={`status${connected.value === "yes" || connected.value === "no" ? "" : " bad"}`} role="status" aria-live="polite" aria-label={words} title={[...(found?.sampler.method ? [`method: ${found.sampler.method}`] : []), ...(found?.warnings ?? []).map((one) => one.title), ...(found?.notes ?? [])].join("\n")}>{ticked(words)}</span>;
}

function close(then: () => void): () => void {
  return () => {
    menu.value = "";
    then();
  };
}

/** What in a menu can have the focus. */
function items(root: HTMLElement): HTMLElement[] {
  return [...root.querySelectorAll<HTMLElement>("button:not(:disabled),input")].filter((one) => one.offsetParent);
}

/** Arrow keys walk a menu, Escape leaves it. */
function walk(event: KeyboardEvent): void {
  const all = items(event.currentTarget as HTMLElement), input = (event.target as HTMLElement).matches("input");
  const at = all.indexOf(document.activeElement as HTMLElement);
  if (event.key === "ArrowDown") all[(at + 1) % all.length]?.focus();
  else if (event.key === "ArrowUp") all[(at - 1 + all.length) % all.length]?.focus();
  else if (event.key === "Home" && !input) all[0]?.focus();
  else if (event.key === "End" && !input) all[all.length - 1]?.focus();
  else if (event.key === "Escape") menu.value = "";
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function Menu({ name, children }: { name: string; children: any }) {
  const root = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => { // at once: the next key is for the menu
    if (!root.current!.contains(document.activeElement)) items(root.current!)[0]?.focus();
  }, [listing.value]);
  useEffect(() => () => void requestAnimationFrame(() => menu.value || focusBack(opener)), []);
  const away = ({ relatedTarget }: FocusEvent) => {
    if (relatedTarget && !root.current!.closest(".bar")!.contains(relatedTarget as Node)) menu.value = "";
  };
  return <div ref={root} class={`menu ${name}`} role="group" aria-label={name} onKeyDown={walk} onFocusOut={away}>{children}</div>;
}

function FileMenu() {
  const found = listing.value;
  const waiting = [...new Set([...waitingTexts(), ...(found?.lost ?? [])])];
  return (
    <Menu name="specs">
      <button class="narrow" disabled={!unsaved.value && !!saved.value.path} onClick={close(() => void saveOrAsk())}>Save</button>
      <button class="narrow" onClick={close(() => void format())}>Format</button>
      <button class="narrow" onClick={close(toggleGrid)}>{layout.value === "many" ? "One large scene" : "Many small scenes"}</button>
      <button onClick={() => openMenu("save")}>Save as… <kbd>Ctrl S</kbd></button>
      <button onClick={close(() => (welcome.value = true))}>Examples with pictures… <kbd>y</kbd></button>
      {waiting.length ? <h2>not saved</h2> : null}
      {waiting.map((name) => <button key={name} data-waiting={name} onClick={close(() => void openWaiting(name))}>{name}</button>)}
      {found?.specs.length ? <h2>{boot.folder}</h2> : null}
      {found?.specs.map((path) => <button key={path} onClick={close(() => void openFile(path))} aria-current={path === saved.value.path}>{path}</button>)}
      <h2>examples of scenegen</h2>
      {found?.shipped.map((one) => <button key={one.name} data-shipped={one.name} onClick={close(() => void openText(one.name, one.text))}><span>{one.name}</span><small>{one.title}</small></button>)}
    </Menu>
  );
}

function SaveMenu() {
  const name = fileName(wanted.value);
  const go = close(() => void save(name));
  return (
    <Menu name="save">
      <label>Save in {boot.folder} as <input value={wanted.value} onInput={(event) => (wanted.value = event.currentTarget.value)} onKeyDown={(event) => event.key === "Enter" && wanted.value.trim() && go()} /></label>
      <button class="strong" disabled={!wanted.value.trim()} onClick={go}>{name === wanted.value ? "Save" : `Save as ${name}`}</button>
    </Menu>
  );
}

export async function copy(value: string, what: string): Promise<void> {
  menu.value = "";
  try {
    await navigator.clipboard.writeText(value);
    message.value = `${what} is copied`;
  } catch {
    prompt(`${what}:`, value);
  }
}

const PLAYED = 100; // moments of a motion that the server draws

function TakeMenu() {
  const none = !scenes.value;
  const line = command();
  const moving = !!spec.value?.time, long = (spec.value?.time?.steps ?? 0) >= PLAYED;
  const formats = boot.formats.filter((one) => one.motions || !moving);
  return (
    <Menu name="take">
      {alone ? (
        <>
          <h2>{shown.value.length} {moving ? "motions" : "scenes"}</h2>
          <div class="formats">
            <button data-format="json" disabled={!shown.value.length} onClick={close(() => void download("json"))}>JSON</button>
            <button data-format="spec" onClick={close(() => void download("spec"))}>Spec</button>
          </div>
          {handMoved().length ? <p class="note">Some were moved by hand. The file then holds poses without phi: <code>scenegen eval {boot.name}.spec {boot.name}_poses.json</code> computes it.</p> : null}
        </>
      ) : (
        <>
          <h2>{shown.value.length} {moving ? "motions" : "scenes"}</h2>
          <div class="formats">
            {formats.map(({ name, title, install }) => <button key={name} data-format={name} disabled={none || !!install} onClick={close(() => void download(name))}>{title}</button>)}
          </div>
          {formats.filter((one) => one.install).map(({ name, title, install }) => <p key={name} class="hint-line">{title}: <code>{install}</code>, then start <code>scenegen view</code> again.</p>)}
        </>
      )}
      {moving && !alone ? (
        <>
          <h2>this motion</h2>
          <div class="formats"><button data-format="gif" disabled={none || long} onClick={close(() => void download("gif"))}>GIF</button></div>
          <p class="hint-line">{long ? "It has too many moments to be drawn here. " : ""}MP4, and files for simulators, are made of a downloaded file: <code>scenegen render</code>, <code>scenegen export</code>.</p>
        </>
      ) : null}
      <h2>this {moving ? "moment" : "scene"}</h2>
      <div class="formats"><button data-format="png" disabled={none} onClick={close(() => void download("png"))}>PNG picture</button></div>
      <h2>the same {moving ? "motions" : "scenes"} by command</h2>
      <code class="command">{line}</code>
      {before() ? <p class="note">{before()}</p> : null}
      <button onClick={() => void copy(line, "the command")}>Copy the command</button>
      {alone ? null : <button onClick={() => void copy(link(), "the link")}>Copy a link to this state</button>}
    </Menu>
  );
}
