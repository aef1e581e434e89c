// Small pictures of many scenes, drawn one after the other by one renderer, so that the page never waits for them.
import { Raycaster, Vector2, Vector3 } from "three";
import type { PackedMesh, Pose, Spec } from "../types";
import { reach } from "./reach";
import { Stage3d } from "./stage3d";
import { drawTop, topScale } from "./top2d";

export interface Wanted {
  canvas: HTMLCanvasElement;
  poses: Pose[];
  bases: number[];
  done?: () => void;
}

const SLICE = 20; // ms of drawing at a time
const KEPT = 300; // pictures

const SMALLEST = 0.04; // of a ring, in shares of the width
const ray = new Raycaster();

type Scene = Pick<Wanted, "poses" | "bases">;
const idle: (then: () => void) => void = "requestIdleCallback" in window ? (then) => requestIdleCallback(then, { timeout: 500 }) : (then) => setTimeout(then, 30);

export class Thumbs {
  private stage: Stage3d | null = null;
  private waiting: Wanted[] = [];
  private drawing = false;
  private later: Scene[] = []; // what may be wanted soon
  private spec: Spec | null = null;
  private framed: Spec | null = null;
  private kept = new Map<Pose[], HTMLCanvasElement>(); // pictures of scenes that may be shown again
  private look = ""; // what these look like
  flat = false;

  setSpec(spec: Spec, packed: Record<string, PackedMesh>): void {
    this.spec = spec;
    const look = `${spec.sha256} ${this.flat} ${document.documentElement.dataset.theme} ${spec.objects.map((one) => (one.mesh in packed ? 1 : 0)).join("")}`;
    if (look !== this.look) {
      this.kept.clear();
      this.later = [];
    }
    this.look = look;
    if (!this.flat) this.three()?.setSpec(spec, packed);
  }

  private three(): Stage3d | null {
    if (!this.stage)
      try {
        this.stage = new Stage3d(document.createElement("canvas"), true);
        this.stage.sun.shadow.mapSize.set(512, 512);
      } catch {
        this.flat = true; // no WebGL: top views instead
      }
    return this.stage;
  }

  draw(all: Wanted[]): void {
    this.waiting = all.filter((one) => !this.again(one));
    if (!this.drawing && this.waiting.length) {
      this.drawing = true;
      requestAnimationFrame(() => setTimeout(() => this.some())); // after the large picture is on the screen
    }
  }

  /** Draw a scene at once, and keep no picture of it: a moment of a motion. */
  play(canvas: HTMLCanvasElement, poses: Pose[], bases: number[]): void {
    if (!this.again({ canvas, poses, bases })) this.one({ canvas, poses, bases }, false);
  }

  /** Draw a scene from its picture, if there is one. */
  private again({ canvas, poses, done }: Wanted): boolean {
    const known = this.kept.get(poses);
    if (!known || known.width !== canvas.width || known.height !== canvas.height) return false;
    const context = canvas.getContext("2d")!;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(known, 0, 0);
    done?.();
    return true;
  }

  /** Draw pictures that may be wanted soon, one at a time, while there is nothing else to do; `done` in the end. */
  prepare(scenes: Scene[], width: number, height: number, done: () => void): void {
    this.later = scenes.filter(({ poses }) => !this.kept.has(poses));
    const mine = this.later;
    const next = () => {
      if (this.later !== mine) return done(); // others took their place
      const one = this.drawing ? undefined : mine.shift();
      if (one) {
        const canvas = document.createElement("canvas");
        canvas.width = width;
        canvas.height = height;
        this.one({ canvas, ...one });
      }
      if (mine.length) idle(next);
      else done();
    };
    idle(next);
  }

  /** The object at a place of a small picture, given in shares of its width and height; null for none. */
  under(at: [number, number], { poses, bases }: Scene): string | null {
    const stage = this.flat ? null : this.stage, now = this.spec;
    if (!now || poses.length !== now.objects.length) return null;
    if (!stage?.spec) {
      const near = now.objects.map((one, k) => ({ name: one.name, ...this.place(k, { poses, bases })! })).filter(({ x, y, r }) => Math.hypot(at[0] - x, (at[1] - y) * 0.75) < r);
      return near.sort((one, two) => one.r - two.r)[0]?.name ?? null;
    }
    if (this.framed !== stage.spec || poses.length !== stage.objects.children.length) return null;
    stage.setPoses(poses, bases);
    stage.scene.updateMatrixWorld();
    ray.setFromCamera(new Vector2(2 * at[0] - 1, 1 - 2 * at[1]), stage.camera);
    const hit = ray.intersectObjects(stage.alike.children, false)[0];
    return hit?.object.userData.names?.[hit.instanceId!] ?? null;
  }

  /** Where an object is in a small picture, in shares of its width and height; `r` in shares of the width. */
  place(index: number, { poses, bases }: Scene): { x: number; y: number; r: number } | null {
    const now = this.spec, pose = poses[index], thing = now?.objects[index];
    if (!now || !pose || !thing) return null;
    const stage = this.flat ? null : this.stage, wide = reach(thing.footprint);
    if (!stage?.spec) {
      const { scale, left, top } = topScale(now, 4, 3);
      return { x: (scale * pose[0] + left) / 4, y: (top - scale * pose[1]) / 3, r: Math.max((scale * wide) / 4, SMALLEST) };
    }
    const seen = (dx: number) => new Vector3(pose[0] + dx, pose[1], (bases[index] ?? 0) + thing.height / 2).project(stage.camera);
    const { x, y } = seen(0);
    return { x: (x + 1) / 2, y: (1 - y) / 2, r: Math.max(Math.abs(seen(wide).x - x) / 2, SMALLEST) };
  }

  private keep(canvas: HTMLCanvasElement, poses: Pose[]): void {
    const copy = document.createElement("canvas");
    copy.width = canvas.width;
    copy.height = canvas.height;
    copy.getContext("2d")!.drawImage(canvas, 0, 0);
    this.kept.set(poses, copy);
    if (this.kept.size > KEPT) this.kept.delete(this.kept.keys().next().value!);
  }

  private some(): void {
    const until = performance.now() + SLICE;
    while (this.waiting.length && performance.now() < until) this.one(this.waiting.shift()!);
    if (this.waiting.length) setTimeout(() => requestAnimationFrame(() => this.some()), 0);
    else this.drawing = false;
  }

  private one(wanted: Wanted, keep = true): void {
    const { canvas, poses, bases } = wanted;
    const context = canvas.getContext("2d");
    if (!context || !this.spec) return;
    const stage = this.flat ? null : this.stage;
    if (!stage?.spec) {
      drawTop(context, this.spec, poses, bases);
      if (keep) this.keep(canvas, poses);
      wanted.done?.();
      return;
    }
    if (poses.length !== stage.objects.children.length) return;
    const { width, height } = canvas;
    const size = stage.renderer.domElement;
    if (size.width !== width || size.height !== height) {
      stage.renderer.setPixelRatio(1);
      stage.renderer.setSize(width, height, false);
    }
    if (stage.camera.aspect !== width / height || this.framed !== stage.spec) stage.frame(width / height);
    this.framed = stage.spec;
    stage.setPoses(poses, bases);
    stage.render();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    context.drawImage(size, 0, 0);
    if (keep) this.keep(canvas, poses);
    wanted.done?.();
  }
}
