// The state of the page in a link, behind the #: it never leaves this machine by itself.
import { boot, edited, label, layout, on, poses, request, saved, selected, spec, tab, text, thing, view } from "./state";
import { frame, path as motion } from "./motions";
import type { Pose, Request } from "./types";
import { token } from "./server";

interface State {
  text?: string;
  name?: string;
  path?: string | null;
  sha?: string | null;
  request: Request;
  scene: number;
  label: string;
  thing: string | null;
  view: "3d" | "top";
  layout: "one" | "many";
  tab: "request" | "why" | "where" | "motion";
  poses?: Pose[];
  on?: number[] | null;
  moments?: Pose[][]; // of a motion
  frame?: number;
}

export function state(): State {
  const { path, sha, name } = saved.value;
  return {
    text: text.value,
    name,
    path,
    sha,
    request: request.value,
    scene: selected.value,
    label: label.value,
    thing: thing.value,
    view: view.value,
    layout: layout.value,
    tab: tab.value,
    ...(edited.value ? (spec.value?.time ? { moments: motion.value, frame: frame.value } : { poses: poses.value, on: on.value }) : {}),
  };
}

export function encode(value: unknown): string {
  const bytes = new TextEncoder().encode(JSON.stringify(value));
  let raw = "";
  for (const one of bytes) raw += String.fromCharCode(one);
  return btoa(raw).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
}

export function decode(value: string): any {
  const raw = atob(value.replace(/-/g, "+").replace(/_/g, "/"));
  return JSON.parse(new TextDecoder().decode(Uint8Array.from(raw, (one) => one.charCodeAt(0))));
}

export function link(): string {
  return `${location.origin}${location.pathname}?token=${encodeURIComponent(token)}#s=${encode(state())}`;
}

/** The state of a link, taken over before anything is shown; the poses of a moved scene come back once it is there. */
export function takeOver(found: Partial<State>, withText: boolean): { poses: Pose[]; on: number[] | null; moments?: Pose[][]; frame?: number } | null {
  if (withText && typeof found.text === "string") {
    text.value = found.text;
    saved.value = { path: found.path ?? null, sha: found.sha ?? null, name: found.name ?? "spec", text: boot.text === found.text ? found.text : null, shipped: boot.text === found.text ? boot.shipped : null };
  }
  const wanted = found.request;
  if (wanted && typeof wanted === "object") request.value = { ...request.value, ...wanted };
  if (typeof found.scene === "number") selected.value = found.scene;
  if (typeof found.label === "string") label.value = found.label;
  if (found.thing === null || typeof found.thing === "string") thing.value = found.thing;
  if (found.view === "3d" || found.view === "top") view.value = found.view;
  if (found.layout === "one" || found.layout === "many") layout.value = found.layout;
  if (found.tab && ["request", "why", "where", "motion"].includes(found.tab)) tab.value = found.tab;
  if (Array.isArray(found.moments)) return { poses: [], on: null, moments: found.moments, frame: found.frame };
  return Array.isArray(found.poses) ? { poses: found.poses, on: Array.isArray(found.on) ? found.on : null } : null;
}
