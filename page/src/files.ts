// Files: specs that are opened and saved, scenes that are taken away.
import { editor, freshName, keepNow, keepOrphan, openInEditor, replaceText } from "./editor/editor";
import { path } from "./motions";
import { table } from "./panels/Stage";
import { connected, Failed, http } from "./server";
import { about, alone, chooser, conflict, message, movedScenes, request, result, saved, shown, spec, text, unsaved, view, type Saved } from "./state";
import { check, forget } from "./store";

export interface Listing {
  specs: string[];
  shipped: { name: string; title: string; text: string }[];
  lost: string[]; // names of what closed tabs left that no file has
}

export async function list(): Promise<Listing> {
  return (await http("/api/files")).json();
}

const named = (path: string) => path.split("/").pop()!.replace(/\.spec$/i, "");

let openings = 0;
let saving: Promise<unknown> = Promise.resolve();

export async function openFile(path: string): Promise<void> {
  const mine = ++openings;
  const found = await http(`/api/file?path=${encodeURIComponent(path)}`).then((answer) => answer.json(), tell);
  if (found) await take({ path, sha: found.sha, text: found.text, name: named(path) }, mine);
}

/** Open an example, or a new text: as it is, even where it was opened before and changed. */
export async function openText(name: string, value: string, shipped = true): Promise<void> {
  await take({ path: null, sha: null, text: value, name: freshName(name), shipped: shipped ? name : null }, ++openings);
}

/** Open what was written earlier and that no file has. */
export async function openWaiting(name: string): Promise<void> {
  await take({ path: null, sha: null, text: null, name }, ++openings);
}

async function take(file: Saved, mine: number): Promise<void> {
  const draft = await http(`/api/draft?name=${encodeURIComponent(file.path ?? file.name)}`).then((answer) => answer.json(), tell);
  await saving; // what is being saved is of the file that is open
  if (mine !== openings) return; // another one was wanted meanwhile
  conflict.value = null;
  forget();
  openInEditor(file, draft);
  message.value = `opened ${file.path ?? file.name}${unsaved.value ? ", with what you had not saved" : ""}`;
  void check();
}

function tell(error: unknown): void {
  message.value = error instanceof Error ? error.message : String(error);
}

/** Look at what is on the disk: where another program wrote it, what is not changed here is loaded again. */
export async function compareWithDisk(path: string): Promise<void> {
  const before = saved.value;
  const found = await http(`/api/file?path=${encodeURIComponent(path)}`).then((answer) => answer.json(), (error) => error);
  if (saved.value !== before) return; // opened or saved meanwhile: what was read is older
  const open = path === before.path;
  if (found instanceof Error) {
    if (open && before.text !== null && found instanceof Failed && found.status === 404) {
      saved.value = { ...before, sha: null, text: null };
      keepOrphan();
      message.value = `${path} is gone from the disk: Save writes it again`;
    }
  } else if (!open || found.sha !== before.sha) {
    if (open && found.text === text.value) saved.value = { ...before, sha: found.sha, text: found.text };
    else if (open && !unsaved.value) {
      takeFromDisk({ path, text: found.text, sha: found.sha });
      message.value = `${path} was changed by another program: this is its new text`;
    } else conflict.value = { path, text: found.text, sha: found.sha };
  }
}

/** Take what is on the disk. It can be undone in its own file; another one gets a history of its own. */
export function takeFromDisk({ path, text, sha }: { path: string; text: string; sha: string }): void {
  const file = { path, sha, text, name: named(path) };
  conflict.value = null;
  if (path === saved.value.path) {
    saved.value = file;
    replaceText(text);
  } else {
    openings++;
    forget();
    openInEditor(file, null);
    void check();
  }
}

/** Save over what another program wrote. */
export async function overwrite({ path, text, sha }: { path: string; text: string; sha: string }): Promise<void> {
  saved.value = { ...saved.value, path, sha, text };
  conflict.value = null;
  await save(path);
}

const LOOK = 3000; // ms between two looks at the file, while the page is in sight

/** Notice what other programs write into the file that is open. */
export function watchDisk(): void {
  const look = () => {
    const { path } = saved.value;
    if (path && !conflict.value && document.visibilityState === "visible" && connected.value === "yes") void compareWithDisk(path);
  };
  setInterval(look, LOOK);
  addEventListener("focus", look);
}

/** The file that a name is saved as: the page saves specs alone. */
export function fileName(wanted: string): string {
  const name = wanted.trim().replace(/\.(txt|text|md|json|ya?ml|toml)$/i, ".spec");
  return /\.spec$/i.test(name) ? name : `${name}.spec`;
}

/** Save what is in the editor now, after what is being saved already. */
export function save(as: string | null = saved.value.path): Promise<unknown> {
  if (as) {
    const now = editor.state.doc.toString();
    saving = saving.then(() => saveNow(as, now));
  }
  return saving;
}

async function saveNow(path: string, now: string): Promise<void> {
  const was = path === saved.value.path ? saved.value.sha : null;
  try {
    const found = await (await http("/api/file", { method: "PUT", body: JSON.stringify({ path, text: now, was }) })).json();
    conflict.value = null;
    saved.value = { path, sha: found.sha, text: now, name: named(path) };
    keepNow();
    message.value = `saved ${path}`;
  } catch (error) {
    tell(error);
    if (error instanceof Failed && error.status === 409) await compareWithDisk(path);
  }
}

function give(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** The text as a file, without a server. */
export function downloadText(): void {
  give(new Blob([editor.state.doc.toString()]), fileName(saved.value.name));
}

export async function download(format: string): Promise<void> {
  const base = saved.value.name || "scenes";
  if (format === "png") {
    const blob = view.value === "3d" ? await table?.picture() : await drawing();
    if (blob) give(blob, `${base}.png`);
    return;
  }
  const found = result.value;
  if (!found) return;
  if (alone) {
    const name = format === "spec" ? `${base}.spec` : `${base}_${handMoved().length ? "poses" : found.motions ? "motions" : "scenes"}.json`;
    give(new Blob([format === "spec" ? text.value : written()]), name);
    message.value = `downloaded ${name}`;
    return;
  }
  // What is on the page: a scene that was moved by hand goes as it stands.
  const hand = (k: number) => movedScenes.get(found.poses[k]);
  const one = (k: number) => (found.motions ? (hand(k)?.path ?? found.motions[k]) : (hand(k)?.poses ?? found.poses[k]));
  const all = format === "gif" ? [path.value] : shown.value.map(one);
  const surfaces = found.on && shown.value.map((k) => (hand(k) ?? { on: found.on![k] }).on);
  const some = shown.value.filter(hand).map((k) => k + 1);
  const sampler = some.length ? { ...found.sampler, edited: some.length > 1 ? some : some[0] } : found.sampler;
  const body = { ...about(), format, poses: all, on: surfaces, request: { ...request.value, n: Math.max(1, all.length) }, sampler };
  if (format === "gif") message.value = "drawing the motion…";
  try {
    const answer = await http("/api/download", { method: "POST", body: JSON.stringify(body) });
    const name = answer.headers.get("content-disposition")?.match(/filename="?([^";]+)"?/)?.[1] ?? `scenes.${format}`;
    give(await answer.blob(), `${base}_${name}`);
    message.value = `downloaded ${base}_${name}`;
  } catch (error) {
    tell(error);
  }
}

/** Of the shown scenes, by number, those that were moved by hand. */
export function handMoved(): number[] {
  return shown.value.filter((k) => movedScenes.has(result.value!.poses[k]));
}

/** The shown scenes as JSON that scenegen reads, without a server. Where some were moved by hand, whose phi nobody
 * knows here, it holds poses alone. */
function written(): string {
  const found = result.value!, now = spec.value!;
  const named = <T>(value: (index: number) => T) => Object.fromEntries(now.objects.map(({ name }, index) => [name, value(index)]));
  const phi = (k: number) => Object.fromEntries(Object.entries(found.phi).map(([name, values]) => [name, values[k]]));
  if (found.motions) return JSON.stringify({ ...alone!.file, motions: shown.value.map((k) => ({ poses: named((index) => found.motions![k].map((one) => one[index])), phi: phi(k) })) });
  const bare = handMoved().length > 0;
  const scenes = shown.value.map((k) => {
    const hand = movedScenes.get(found.poses[k]), on = hand?.on ?? found.on?.[k];
    const poses = named((index) => {
      const [x, y, theta] = (hand?.poses ?? found.poses[k])[index], { name, surfaces } = now.objects[index];
      return { x, y, theta, ...(on && surfaces.length > 1 ? { on: surfaces[on[chooser(now, name)] - 1] } : {}) };
    });
    return bare ? { poses } : { poses, phi: phi(k) };
  });
  return JSON.stringify(bare ? { scenes } : { ...alone!.file, scenes });
}

/** The top view as a picture. */
async function drawing(): Promise<Blob | null> {
  const svg = document.querySelector<SVGSVGElement>("svg.top");
  if (!svg) return null;
  const copy = svg.cloneNode(true) as SVGSVGElement;
  const old = [svg, ...svg.querySelectorAll<SVGElement>("*")], fresh = [copy, ...copy.querySelectorAll<SVGElement>("*")];
  old.forEach((one, k) => {
    const style = getComputedStyle(one);
    for (const name of ["fill", "fill-opacity", "stroke", "stroke-width", "paint-order", "opacity", "font-family", "font-weight", "font-style"]) fresh[k].style.setProperty(name, style.getPropertyValue(name));
  });
  const { width, height } = svg.viewBox.baseVal;
  copy.setAttribute("width", "1600");
  copy.setAttribute("height", String(Math.round((1600 * height) / width)));
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(copy))}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = 1600;
  canvas.height = Math.round((1600 * height) / width);
  canvas.getContext("2d")!.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}
