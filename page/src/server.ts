// The WebSocket to the server: jobs with answers, and HTTP for files.
import { signal } from "@preact/signals";
import type { Refusal } from "./types";

export const token = new URLSearchParams(location.search).get("token") ?? "";
const hex = (bytes: Uint8Array) => [...bytes].map((one) => one.toString(16).padStart(2, "0")).join("");
export const tabId = hex(crypto.getRandomValues(new Uint8Array(12)));
/** full: the server takes no more pages; other: a server that has another link */
export const connected = signal<"yes" | "no" | "lost" | "full" | "other">("no");

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
const MOST_PAUSE = 3000; // ms between two attempts to reach the server
let closed = false; // the connection was lost, or there was none
let trusted = true; // who listens is the server
let retry: ReturnType<typeof setTimeout> | undefined;
const waiting = new Map<number, Waiting>();
const again: (() => void)[] = [];

/** Calls `then` whenever a connection that was lost is there again. */
export function onReconnect(then: () => void): void {
  again.push(then);
}

/** Who listens where the server was: `here` is a server that knows the token. Another program must not learn it: it is
 * asked for a proof before anything is sent to it. */
async function whoListens(): Promise<"here" | "other" | "lost"> {
  const nonce = hex(crypto.getRandomValues(new Uint8Array(16))), bytes = (text: string) => new TextEncoder().encode(text);
  try {
    const answer = await fetch(`/api/proof?nonce=${nonce}`, { cache: "no-store" });
    const told = await answer.text();
    if (!crypto.subtle) return (await fetch("/api/prelude", { headers: { Authorization: `Bearer ${token}` } })).ok ? "here" : "other"; // over the network, unencrypted
    const key = await crypto.subtle.importKey("raw", bytes(token), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
    return hex(new Uint8Array(await crypto.subtle.sign("HMAC", key, bytes(nonce)))) === told ? "here" : "other";
  } catch {
    return "lost";
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
  opening ??= begin().finally(() => (opening = null));
  return opening;
}

function later(): void {
  clearTimeout(retry);
  retry = setTimeout(() => void open().catch(() => {}), pause);
  pause = Math.min(pause * 2, MOST_PAUSE);
}

async function begin(): Promise<WebSocket> {
  const who = trusted ? "here" : await whoListens();
  if (who !== "here") {
    connected.value = who;
    later();
    throw new Ended("no connection");
  }
  trusted = true;
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const one = new WebSocket(`${scheme}://${location.host}/api/socket?token=${encodeURIComponent(token)}&tab=${tabId}`);
  one.onmessage = (event) => hear(JSON.parse(event.data));
  return new Promise((resolve, reject) => {
    let opened = false;
    one.onopen = () => {
      opened = true;
      socket = one;
      pause = 300;
      connected.value = "yes";
      resolve(one);
      const back = closed;
      closed = false;
      if (back) for (const then of again) then();
    };
    one.onclose = () => {
      socket = null;
      if (!opened && closed) connected.value = "full"; // who listens knows the token
      else if (connected.value === "yes") connected.value = "no";
      closed = true;
      trusted = false;
      for (const [key, one] of waiting) {
        waiting.delete(key);
        one.reject(new Ended("the connection is lost"));
      }
      reject(new Ended("no connection"));
      later();
    };
  });
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
  else if ("failed" in answer) one.reject(/try again in a moment$/.test(answer.failed) ? new Crowded(answer.failed) : failure(answer.failed));
  else if ("ended" in answer) one.reject(new Ended(NEWER));
  else one.resolve();
}

const NEWER = "a newer request took its place";
const failure = (title: string) => new Refused({ title, label: "", note: "", help: "", text: title });
class Crowded extends Error {}
const MOMENT = 400; // ms until a server that has too much to do is asked again
const newest = new Map<string, number>(); // the last message of each job

/** Do a job; `part` is given each answer. */
export async function ask(job: string, fields: Record<string, unknown>, part: (value: any) => void): Promise<void> {
  const line = await open();
  const id = ++number;
  const message = JSON.stringify({ id, job, ...fields });
  const title = tooLarge(fields.text, message);
  if (title) throw failure(title);
  newest.set(job, id);
  try {
    await new Promise<void>((resolve, reject) => {
      waiting.set(id, { part, resolve, reject });
      line.send(message);
    });
  } catch (error) {
    if (!(error instanceof Crowded)) throw error;
    await new Promise((then) => setTimeout(then, MOMENT));
    if (newest.get(job) !== id) throw new Ended(NEWER);
    await ask(job, fields, part);
  }
}

/** The only answer of a job. */
export async function askOne<T>(job: string, fields: Record<string, unknown>): Promise<T> {
  let found: T | undefined;
  await ask(job, fields, (value) => (found = value));
  return found as T;
}

export async function stop(job: string): Promise<void> {
  newest.delete(job);
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ stop: job }));
}

/** An HTTP request with the token. A refusal is an Error with the server's sentence. */
export async function http(path: string, options: RequestInit = {}): Promise<Response> {
  if (!trusted && (await whoListens()) !== "here") throw new Failed("the server does not answer", 0);
  const headers = { Authorization: `Bearer ${token}`, ...(options.headers ?? {}) };
  const answer = await fetch(path, { ...options, headers });
  if (answer.ok) return answer;
  const text = await answer.text();
  if (answer.headers.get("content-type")?.includes("json")) throw new Refused(JSON.parse(text));
  throw new Failed(text.trim() || `the server answered ${answer.status}`, answer.status);
}
