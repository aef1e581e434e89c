// Objects that are moved by hand, and how a motion is played back.
import { batch } from "@preact/signals";
import { askOne } from "./server";
import { about, alone, edited, message, chooser, moment, motion, movable, on, poses, replaying, request, result, selected, spec, type Motion } from "./state";
import { change as changeMotion, playMotion, timed } from "./motions";
import { explain, remember } from "./store";
import type { Pose, Report } from "./types";

const TURN = 2 * Math.PI;

export function wrapped(theta: number): number {
  const rest = ((theta % TURN) + TURN) % TURN;
  return rest < TURN ? rest : 0;
}

export function place(name: string, pose: Partial<{ x: number; y: number; theta: number }>): void {
  const now = spec.value;
  if (!now || !movable.value) return;
  const index = now.objects.findIndex((one) => one.name === name);
  if (index < 0 || now.objects[index].fixed) return;
  const { x, y } = now.workspace;
  const [oldX, oldY, oldTheta] = poses.value[index];
  const next: Pose = [
    Math.min(Math.max(pose.x ?? oldX, x[0]), x[1]),
    Math.min(Math.max(pose.y ?? oldY, y[0]), y[1]),
    pose.theta === undefined ? oldTheta : wrapped(pose.theta),
  ];
  gesture(name);
  batch(() => {
    if (timed.value) changeMotion(index, next, name in request.value.fix);
    else poses.value = poses.value.map((one, at) => (at === index ? next : one));
    edited.value = true;
    if (name in request.value.fix) request.value = { ...request.value, fix: { ...request.value.fix, [name]: next } };
  });
  if (!timed.value && !alone) record(name, next);
  explain();
}

let gripped = { name: "", at: 0 };

/** A drag, or a series of key presses, is taken back as one. */
function gesture(name: string): void {
  const now = performance.now();
  if (gripped.name !== name || now - gripped.at > GAP) remember();
  gripped = { name, at: now };
}

export function hold(name: string): void {
  const now = spec.value;
  const index = now?.objects.findIndex((one) => one.name === name) ?? -1;
  if (!now || index < 0 || now.objects[index].fixed || alone) return;
  const fix = { ...request.value.fix };
  if (name in fix) delete fix[name];
  else fix[name] = poses.value[index];
  const choice = now.objects[index].surfaces.length > 1 ? "; its surface can still change" : "";
  message.value = name in fix ? `${name} is kept in place${choice}${timed.value ? ": in new motions it stands there all the time" : ""}` : `${name} can move again`;
  request.value = { ...request.value, fix };
}

/** Put an object with several surfaces onto another one: the next, or the one with this number, from 1. */
export function putOn(name: string, number?: number): void {
  const now = spec.value;
  const column = now ? chooser(now, name) : -1;
  if (!now || alone || column < 0 || !on.value) return;
  const { surfaces } = now.objects.find((one) => one.name === name)!;
  const next = number ?? (on.value[column] % surfaces.length) + 1;
  remember();
  on.value = on.value.map((one, at) => (at === column ? next : one));
  edited.value = true;
  message.value = `${name} stands on ${surfaces[next - 1]}`;
  explain();
}

// ---- motions

let recording: { name: string; began: number; last: number; times: number[]; path: Pose[] } | null = null;
const GAP = 1500; // ms without a move after which a new motion begins
const MOST = 400;

function record(name: string, pose: Pose): void {
  const now = performance.now();
  if (!recording || recording.name !== name || now - recording.last > GAP) {
    const index = spec.value!.objects.findIndex((one) => one.name === name);
    recording = { name, began: now, last: now, times: [0], path: [result.value?.poses[selected.value]?.[index] ?? pose] };
    if (edited.value && motion.value?.name === name) recording.path = [pose];
  }
  recording.last = now;
  recording.times.push((now - recording.began) / 1000);
  recording.path.push(pose);
  if (recording.path.length > MOST) {
    recording.times = recording.times.filter((_, at) => at % 2 === 0);
    recording.path = recording.path.filter((_, at) => at % 2 === 0);
  }
}

/** The end of a drag or of a series of key presses: what was moved can be played back. */
export async function moved(): Promise<void> {
  gripped = { name: "", at: 0 };
  if (!recording || recording.path.length < 2) return;
  const { name, times, path } = recording;
  const mine: Motion = { name, times: [...times], path: [...path], phi: null };
  motion.value = mine;
  moment.value = times[times.length - 1];
  await scoreMotion(mine);
}

async function scoreMotion(mine: Motion): Promise<void> {
  const index = spec.value?.objects.findIndex((one) => one.name === mine.name) ?? -1;
  if (index < 0) return;
  const frames = mine.path.map((pose) => poses.value.map((one, at) => (at === index ? pose : one)));
  try {
    const found = await askOne<Report>("evaluate", { ...about(), poses: frames, on: on.value && frames.map(() => on.value), why: false });
    if (motion.value === mine) motion.value = { ...mine, phi: found.phi };
  } catch {
    /* a newer question took its place; the plot is drawn with the next motion */
    if (motion.value === mine) setTimeout(() => motion.value === mine && void scoreMotion(mine), 200);
  }
}

/** Show the motion at a time; phi is that of the plot until the motion rests. */
export function seek(time: number): void {
  const one = motion.value;
  const now = spec.value;
  if (!one || !now) return;
  moment.value = time;
  const index = now.objects.findIndex((two) => two.name === one.name);
  let at = one.times.findIndex((two) => two >= time);
  if (at < 0) at = one.times.length - 1;
  poses.value = poses.value.map((two, place) => (place === index ? one.path[at] : two));
  edited.value = true;
  explain();
}

export function play(): void {
  if (timed.value) return playMotion();
  const one = motion.value;
  if (!one || replaying.value) {
    replaying.value = false;
    return;
  }
  const last = one.times[one.times.length - 1];
  const from = moment.value >= last - 1e-6 ? 0 : moment.value;
  const began = performance.now() - from * 1000;
  replaying.value = true;
  const frame = () => {
    if (!replaying.value || motion.value?.path !== one.path) {
      replaying.value = false;
      return;
    }
    const time = (performance.now() - began) / 1000;
    seek(Math.min(time, last));
    if (time < last) requestAnimationFrame(frame);
    else replaying.value = false;
  };
  requestAnimationFrame(frame);
}
