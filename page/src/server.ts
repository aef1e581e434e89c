// The WebSocket to the server: jobs with answers, and HTTP for files.
import { signal } from "@preact/signals";
import type { Refusal } from "./types";

export const token = new URLSearchParams(location.search).get("token") ?? "";
export const connected = signal<"yes" | "no" | "lost" | "full">("no"); // full: the server takes no more pages

export class Ended extends Error {}
export class Refused extends Error {
  constructor(public refusal: Refusal) {
    super(refusal.title);
  }
}

export class Failed extends Error {
  constructor(words: string, public status: number) {
    super(words);
  }
}

interface Waiting {
  part: (value: any) => void;
  resolve: () => void;
  reject: (reason: Error) => void;
}

let socket: WebSocket | null = null;
let opening: Promise<WebSocket> | null = null;
let number = 0;
let pause = 300;
let closed = false; // the connection was lost, or there was none
const waiting = new Map<number, Waiting>();
const again: (() => void)[] = [];

/** Calls `then` whenever a connection that was lost is there again. */
export function onReconnect(then: () => void): void {
  again.push(then);
}

/** Whether the server answers at all. */
async function alive(): Promise<boolean> {
  try {
    return (await fetch("/static/icon.svg", { cache: "no-store" })).ok;
  } catch {
    return false;
  }
}

const MOST_TEXT = 256 * 1024, MOST = 1_000_000; // bytes of a spec and of a message that the server takes

function tooLarge(text: unknown, message: string): string {
  const bytes = (one: string) => (one.length * 3 < MOST_TEXT ? 0 : new TextEncoder().encode(one).length);
  if (typeof text === "string" && bytes(text) > MOST_TEXT) return `a spec on the page has at most ${MOST_TEXT >> 10} kB`;
  return bytes(message) > MOST ? "this is more than the server takes in one message: ask for fewer scenes" : "";
}

function open(): Promise<WebSocket> {
  if (socket?.readyState === WebSocket.OPEN) return Promise.resolve(socket);
  opening ??= new Promise((resolve, reject) => {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const one = new WebSocket(`${scheme}://${location.host}/api/socket?token=${encodeURIComponent(token)}`);
    let opened = false;
    one.onopen = () => {
      opened = true;
      socket = one;
      opening = null;
      pause = 300;
      connected.value = "yes";
      resolve(one);
      if (closed) for (const then of again) then();
      closed = false;
    };
    one.onmessage = (event) => hear(JSON.parse(event.data));
    one.onclose = () => {
      opening = null;
      socket = null;
      closed = true;
      void alive().then((there) => connected.value !== "yes" && (connected.value = there && !opened ? "full" : there ? "no" : "lost"));
      if (connected.value === "yes") connected.value = "no";
      for (const [key, one] of waiting) {
        waiting.delete(key);
        one.reject(new Ended("the connection is lost"));
      }
      reject(new Ended("no connection"));
      setTimeout(() => void open().catch(() => {}), pause);
      pause = Math.min(pause * 2, 5000);
    };
  });
  return opening;
}

function hear(answer: any): void {
  const one = waiting.get(answer.id);
  if (!one) return;
  if ("part" in answer) {
    one.part(answer.part);
    return;
  }
  waiting.delete(answer.id);
  if ("refused" in answer) one.reject(new Refused(answer.refused));
  else if ("failed" in answer)
    one.reject(new Refused({ title: answer.failed, label: "", note: "", help: "", text: answer.failed }));
  else if ("ended" in answer) one.reject(new Ended("a newer request took its place"));
  else one.resolve();
}

/** Do a job; `part` is given each answer. */
export async function ask(job: string, fields: Record<string, unknown>, part: (value: any) => void): Promise<void> {
  const line = await open();
  const id = ++number;
  const message = JSON.stringify({ id, job, ...fields });
  const title = tooLarge(fields.text, message);
  if (title) throw new Refused({ title, label: "", note: "", help: "", text: title });
  return new Promise((resolve, reject) => {
    waiting.set(id, { part, resolve, reject });
    line.send(message);
  });
}

/** The only answer of a job. */
export async function askOne<T>(job: string, fields: Record<string, unknown>): Promise<T> {
  let found: T | undefined;
  await ask(job, fields, (value) => (found = value));
  return found as T;
}

export async function stop(job: string): Promise<void> {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ stop: job }));
}

/** An HTTP request with the token. A refusal is an Error with the server's sentence. */
export async function http(path: string, options: RequestInit = {}): Promise<Response> {
  const headers = { Authorization: `Bearer ${token}`, ...(options.headers ?? {}) };
  const answer = await fetch(path, { ...options, headers });
  if (answer.ok) return answer;
  const text = await answer.text();
  if (answer.headers.get("content-type")?.includes("json")) throw new Refused(JSON.parse(text));
  throw new Failed(text.trim() || `the server answered ${answer.status}`, answer.status);
}
