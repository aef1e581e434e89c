// The large view: the table, what stands on it, dimension lines, and hands on all of it.
import { DoubleSide, Group, Mesh, MeshBasicMaterial, Plane, Raycaster, RingGeometry, SphereGeometry, Vector2, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Mark, PackedMesh, Point, Pose, Spec } from "../types";
import { round125, spoken, spokenText } from "../words";
import { apart, PIXELS, shortened, type Box, type Tag } from "./apart";
import { outline, reach } from "./reach";
import { dashes, ribbon } from "./ribbons";
import { corner, Stage3d } from "./stage3d";

export interface Hands {
  pick(name: string | null): void;
  move(name: string, x: number, y: number): void;
  turn(name: string, theta: number): void;
  end(): void;
  free(name: string): boolean;
  light(name: string | null): void;
}

const SLOW = 34; // ms between two pictures above which they get coarser while something moves
const COARSEST = 0.4;
const TOUCH = matchMedia("(pointer: coarse)").matches;
const COVERED = TOUCH ? { top: 156, bottom: 66 } : { top: 112, bottom: 48 }; // pixels that phi, what is said of the chosen object, and the buttons cover
const LEGIBLE = 340; // pixels: in a lower view the words at the axes would cover them
const MOST_COVERED = 0.28; // of the height

export class Table3d extends Stage3d {
  readonly controls: OrbitControls;
  private marks = new Group();
  private trails = new Group();
  private axes = new Group();
  private axisTags: { at: Vector3; text: string }[] = [];
  private ring = new Group();
  private halo: Mesh; // round the object that is lit
  private knob: Mesh;
  private dirty = true;
  private scheduled = false;
  private running = true;
  private held: { name: string; kind: "move" | "turn"; offset: Vector2; plane: Plane } | null = null;
  private ray = new Raycaster();
  private chosen: string | null = null;
  private lit: string | null = null;
  private markTags: { at: Vector3; text: string; good: boolean }[] = [];
  private ratio = Math.min(devicePixelRatio || 1, 2);
  private now = this.ratio;
  private lastMove = 0;
  private last = 0;
  private slow = 0;
  private framed = "";
  private seen = { width: 1, height: 1 }; // of the view, in pixels of the window
  private said: Tag[] = []; // the words over the picture
  private waiting = false; // for scenes: until they are there the last picture stays
  names = false;
  onTags: (tags: Tag[]) => void = () => {};
  frames = 0; // for tests: how many pictures were drawn
  spent = 0; // ms of drawing

  constructor(canvas: HTMLCanvasElement, private hands: Hands) {
    super(canvas, false);
    this.renderer.setPixelRatio(this.now);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = 0.49 * Math.PI;
    this.controls.zoomSpeed = 0.8;
    this.controls.addEventListener("change", () => {
      this.lastMove = performance.now();
      this.wake();
    });
    const accent = new MeshBasicMaterial({ color: 0x0b7a5c, side: DoubleSide, transparent: true, opacity: 0.85, depthWrite: false });
    this.knob = new Mesh(new SphereGeometry(1, 20, 14), new MeshBasicMaterial({ color: 0x0b7a5c }));
    this.knob.name = "\0knob";
    this.ring.add(new Mesh(new RingGeometry(0.94, 1, 64), accent), this.knob);
    this.ring.visible = false;
    this.halo = new Mesh(new RingGeometry(0.9, 1, 64), new MeshBasicMaterial({ color: 0xe09a00, side: DoubleSide, transparent: true, opacity: 0.9, depthTest: false }));
    this.halo.renderOrder = 9;
    this.halo.visible = false;
    this.scene.add(this.axes, this.trails, this.marks, this.ring, this.halo);
    canvas.addEventListener("pointerdown", this.down, { capture: true });
    canvas.addEventListener("pointermove", this.hover);
    canvas.addEventListener("pointerleave", () => this.hands.light(null));
    canvas.addEventListener("pointerup", this.up);
    canvas.addEventListener("pointercancel", this.up);
    this.schedule();
  }

  wake(): void {
    this.dirty = true;
    this.schedule();
  }

  /** Pictures are drawn when something changes: a page at rest leaves the processor to others. */
  private schedule(): void {
    if (this.scheduled || !this.running) return;
    this.scheduled = true;
    requestAnimationFrame(this.loop);
  }

  override setSpec(spec: Spec, packed: Record<string, PackedMesh>): void {
    super.setSpec(spec, packed);
    const key = JSON.stringify([spec.table, spec.workspace, spec.tall > 0.35 * this.side && spec.tall]);
    if (this.framed !== key) {
      this.framed = key;
      this.setAxes(spec);
      this.reset();
    }
    this.wake();
  }

  override setPoses(poses: Pose[], bases: number[]): void {
    super.setPoses(poses, bases);
    this.place();
    this.wake();
  }

  reset(): void {
    if (!this.spec) return;
    this.frame(this.camera.aspect);
    this.controls.target.copy(this.middle());
    this.controls.minDistance = 0.25 * this.side;
    this.controls.maxDistance = 8 * this.side;
    this.controls.update();
    this.wake();
  }

  /** Turn and zoom the camera by hand of the keyboard. */
  orbit(left: number, up: number, zoom = 1): void {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const length = Math.min(Math.max(arm.length() * zoom, this.controls.minDistance), this.controls.maxDistance);
    const polar = Math.min(Math.max(Math.acos(arm.z / arm.length()) - up, 0.02), 0.48 * Math.PI);
    const around = Math.atan2(arm.y, arm.x) + left;
    arm.set(Math.sin(polar) * Math.cos(around), Math.sin(polar) * Math.sin(around), Math.cos(polar)).multiplyScalar(length);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.wake();
  }

  resize(width: number, height: number): void {
    if (width < 2 || height < 2) return;
    this.seen = { width, height };
    this.covered = { top: Math.min(COVERED.top / height, MOST_COVERED), bottom: Math.min(COVERED.bottom / height, MOST_COVERED) };
    const first = this.camera.aspect;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (Math.abs(first - width / height) > 0.02) this.reset();
    this.wake();
  }

  wait(waiting: boolean): void {
    this.waiting = waiting;
    if (!waiting) this.wake();
  }

  choose(name: string | null): void {
    this.chosen = name;
    this.place();
    this.wake();
  }

  /** Light an object, wherever its name is pointed at. */
  light(name: string | null): void {
    if (this.lit === name) return;
    this.lit = name;
    this.place();
    this.wake();
  }

  private place(): void {
    const lit = this.objects.children.findIndex((one) => one.name === this.lit);
    this.halo.visible = lit >= 0 && this.objects.children[lit].visible;
    if (this.halo.visible) {
      const { x, y, z } = this.objects.children[lit].position;
      this.halo.position.set(x, y, z + 0.002 * this.side);
      this.halo.scale.setScalar(1.08 * reach(this.spec!.objects[lit].footprint) + 0.014 * this.side);
    }
    const mesh = this.objects.children.find((one) => one.name === this.chosen);
    this.ring.visible = !!mesh && mesh.visible;
    if (!mesh || !this.spec) return;
    const thing = this.spec.objects.find((one) => one.name === this.chosen)!;
    const radius = 1.12 * reach(thing.footprint) + 0.012 * this.side;
    this.ring.position.set(mesh.position.x, mesh.position.y, mesh.position.z + 0.0025 * this.side);
    this.ring.children[0].scale.setScalar(radius);
    this.knob.scale.setScalar(0.014 * this.side);
    this.knob.visible = this.hands.free(thing.name);
    this.knob.position.set(radius * Math.cos(mesh.rotation.z), radius * Math.sin(mesh.rotation.z), 0.004 * this.side);
  }

  /** At the front left corner of the workspace: where x and y go, and how long a round length is. */
  private setAxes(spec: Spec): void {
    for (const one of this.axes.children) (one as Mesh).geometry.dispose();
    this.axes.clear();
    const long = round125(this.side / 6), wide = 0.004 * this.side, tip = 0.022 * this.side;
    const [x, y] = corner(spec);
    const arrow = (to: (along: number, across: number) => Point): [Point, Point][] => [[to(0, 0), to(long, 0)], [to(long, 0), to(long - tip, 0.6 * tip)], [to(long, 0), to(long - tip, -0.6 * tip)]];
    const lines = [...arrow((along, across) => [x + along, y + across]), ...arrow((along, across) => [x + across, y + along])];
    const drawn = ribbon(lines, wide, 0x5b4127, 0.0015 * this.side);
    (drawn.material as MeshBasicMaterial).depthTest = true; // they lie on the table: objects stand over them
    drawn.renderOrder = 0;
    this.axes.add(drawn);
    const at = (u: number, v: number) => new Vector3(x + u, y + v, 0);
    this.axisTags = [{ at: at(long + tip, 0), text: "x" }, { at: at(0, long + tip), text: "y" }, { at: at(0.5 * long, -1.1 * tip), text: spoken(long, "m") }];
  }

  /** The ways of objects over the table. */
  setTrails(trails: { points: Point[]; color: string }[]): void {
    for (const one of this.trails.children) (one as Mesh).geometry.dispose();
    this.trails.clear();
    for (const { points, color } of trails) {
      const parts = points.slice(1).map((end, k): [Point, Point] => [points[k], end]).filter(([a, b]) => a[0] !== b[0] || a[1] !== b[1]);
      this.trails.add(ribbon(parts, 0.0045 * this.side, parseInt(color.slice(1), 16), 0.002 * this.side));
    }
    this.wake();
  }

  setMarks(marks: Mark[], height: number): void {
    for (const one of this.marks.children) (one as Mesh).geometry.dispose();
    this.marks.clear();
    this.markTags = [];
    const wide = 0.0035 * this.side;
    for (const mark of marks) {
      if (mark.kind === "guide") {
        this.marks.add(ribbon(dashes(mark.start, mark.end, 0.02 * this.side), 0.6 * wide, 0x6b7078, height));
        continue;
      }
      const color = mark.good ? 0x0b8f6b : 0xd0382f;
      if (mark.kind === "line") {
        const [dx, dy] = [mark.end[0] - mark.start[0], mark.end[1] - mark.start[1]];
        const length = Math.hypot(dx, dy) || 1e-9;
        const tick = 0.016 * this.side;
        const across: Point = [(-dy / length) * tick, (dx / length) * tick];
        const ticks = [mark.start, mark.end].map((end): [Point, Point] => [[end[0] - across[0], end[1] - across[1]], [end[0] + across[0], end[1] + across[1]]]);
        this.marks.add(ribbon([[mark.start, mark.end], ...ticks], wide, color, height));
        this.markTags.push({ at: new Vector3((mark.start[0] + mark.end[0]) / 2, (mark.start[1] + mark.end[1]) / 2, height), text: spokenText(mark.text), good: mark.good });
      } else {
        const radius = 0.09 * this.side;
        const at = (angle: number): Point => [mark.center[0] + radius * Math.cos(angle), mark.center[1] + radius * Math.sin(angle)];
        const arc: [Point, Point][] = [];
        for (let k = 0; k < 24; k++) arc.push([at(mark.from + ((mark.to - mark.from) * k) / 24), at(mark.from + ((mark.to - mark.from) * (k + 1)) / 24)]);
        this.marks.add(ribbon([[mark.center, at(mark.from)], [mark.center, at(mark.to)], ...arc], wide, color, height));
        const middle = at((mark.from + mark.to) / 2);
        this.markTags.push({ at: new Vector3(middle[0], middle[1], height), text: spokenText(mark.text), good: mark.good });
      }
    }
    this.wake();
  }

  private pointer(event: PointerEvent): void {
    const box = this.renderer.domElement.getBoundingClientRect();
    this.ray.setFromCamera(new Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height), this.camera);
  }

  private under(): string | null {
    if (this.ring.visible && this.knob.visible && this.ray.intersectObject(this.knob).length) return this.knob.name;
    const hit = this.ray.intersectObjects([...this.alike.children, ...this.boards.children], false)[0];
    return hit?.object.userData.names?.[hit.instanceId!] ?? null; // boards have no names: what they hide cannot be gripped
  }

  private onPlane(plane: Plane): Vector3 | null {
    return this.ray.ray.intersectPlane(plane, new Vector3());
  }

  private down = (event: PointerEvent): void => {
    if (event.button > 0) return;
    this.pointer(event);
    const name = this.under();
    if (!name) return;
    const turning = name === this.knob.name;
    const target = turning ? this.chosen! : name;
    const mesh = this.objects.children.find((one) => one.name === target)!;
    if (!turning) this.hands.pick(target);
    if (!this.hands.free(target)) return;
    const plane = new Plane(new Vector3(0, 0, 1), -mesh.position.z - (turning ? 0 : this.grip(event, mesh.position.z)));
    const at = this.onPlane(plane);
    if (!at) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.renderer.domElement.focus({ preventScroll: true });
    this.renderer.domElement.setPointerCapture(event.pointerId);
    this.held = { name: target, kind: turning || event.shiftKey ? "turn" : "move", plane, offset: new Vector2(mesh.position.x - at.x, mesh.position.y - at.y) };
  };

  /** How far above its base an object was gripped, so that it stays under the pointer. */
  private grip(_event: PointerEvent, base: number): number {
    const hit = this.ray.intersectObjects(this.alike.children, false)[0];
    return hit ? Math.max(0, hit.point.z - base) : 0;
  }

  private hover = (event: PointerEvent): void => {
    this.pointer(event);
    if (!this.held) {
      const name = this.under();
      this.hands.light(name === this.knob.name ? this.chosen : name);
      this.renderer.domElement.style.cursor = name === this.knob.name ? "grab" : name ? (this.hands.free(name) ? "move" : "pointer") : "";
      return;
    }
    const at = this.onPlane(this.held.plane);
    if (!at) return;
    this.lastMove = performance.now();
    const mesh = this.objects.children.find((one) => one.name === this.held!.name)!;
    if (this.held.kind === "move") this.hands.move(this.held.name, at.x + this.held.offset.x, at.y + this.held.offset.y);
    else this.hands.turn(this.held.name, Math.atan2(at.y - mesh.position.y, at.x - mesh.position.x));
  };

  private up = (event: PointerEvent): void => {
    if (!this.held) return;
    this.held = null;
    if (this.renderer.domElement.hasPointerCapture(event.pointerId)) this.renderer.domElement.releasePointerCapture(event.pointerId);
    this.hands.end();
  };

  private loop = (): void => {
    this.scheduled = false;
    if (!this.running) return;
    const moving = performance.now() - this.lastMove < 300;
    if (!moving && this.now !== this.ratio) {
      this.now = this.ratio;
      this.renderer.setPixelRatio(this.now);
      this.renderer.shadowMap.needsUpdate = true;
      this.dirty = true;
    } else if (moving) this.schedule();
    if (!this.dirty) return;
    if (!this.objects.children.some((one) => one.visible)) {
      this.said = [];
      this.onTags([]);
      if (this.waiting || !this.spec) return; // to draw an empty table would hold up the scenes
    }
    this.dirty = false;
    const began = performance.now();
    if (this.slow > 2 && this.frames % 2) this.renderer.shadowMap.needsUpdate = false; // shadows follow a picture later
    this.render();
    this.frames++;
    this.spent += performance.now() - began;
    // Drawing is done by another process: how long it takes shows in how soon the next picture can be drawn.
    const apart = began - this.last;
    this.last = began;
    this.slow = moving && apart > SLOW && apart < 1000 ? this.slow + 1 : moving ? Math.max(0, this.slow - 1) : 0;
    if (this.slow >= 3 && this.now > COARSEST) {
      this.slow = 1;
      this.now = Math.max(COARSEST, this.now * 0.7);
      this.renderer.setPixelRatio(this.now);
    }
    this.tags();
  };

  private tags(): void {
    const box = this.seen; // to measure it would lay the page out anew
    const tags: Tag[] = [], boxes: Box[] = [];
    const seen = (at: Vector3) => {
      const { x, y, z } = at.project(this.camera);
      return { x: ((x + 1) / 2) * box.width, y: ((1 - y) / 2) * box.height, behind: z >= 1 };
    };
    const put = (at: Vector3, text: string, kind: Tag["kind"], up: number) => {
      const { x, y, behind } = seen(at.clone());
      if (!behind) tags.push({ x, y: y - up, text, kind });
    };
    if (box.height >= LEGIBLE) for (const { at, text } of this.axisTags) put(at, text, "axis", 0);
    for (const tag of this.markTags) put(tag.at, tag.text, tag.good ? "good" : "bad", 20);
    const wanted = (name: string, says: string) => this.names || name === this.chosen || name === this.lit || says;
    const things = this.objects.children.map((mesh, k) => ({ mesh, thing: this.spec!.objects[k] })).filter(({ mesh }) => mesh.visible);
    if (things.some(({ mesh, thing }) => wanted(mesh.name, thing.says)))
      for (const { mesh, thing } of things) {
        const of: Box = { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity };
        for (const [u, v] of outline(thing.footprint))
          for (const z of [0, thing.height]) {
            const { x, y } = seen(mesh.localToWorld(new Vector3(u, v, z)));
            Object.assign(of, { x0: Math.min(of.x0, x), x1: Math.max(of.x1, x), y0: Math.min(of.y0, y), y1: Math.max(of.y1, y) });
          }
        boxes.push(of);
        const kind = mesh.name === this.chosen ? "chosen" : mesh.name === this.lit ? "lit" : "name";
        if (wanted(mesh.name, thing.says)) tags.push({ x: 0, y: 0, text: kind === "name" ? shortened(mesh.name) : mesh.name, kind, of });
      }
    const view = { x0: 2, y0: this.covered.top * box.height, x1: box.width - 2, y1: box.height * (1 - this.covered.bottom) };
    this.said = apart(tags, boxes, view, PIXELS);
    this.onTags(this.said);
  }

  /** Where an object is on the screen, in pixels of the window. */
  where(name: string): { x: number; y: number } | null {
    const mesh = this.objects.children.find((one) => one.name === name);
    const thing = this.spec?.objects.find((one) => one.name === name);
    if (!mesh || !thing) return null;
    const seen = new Vector3(mesh.position.x, mesh.position.y, mesh.position.z + thing.height / 2).project(this.camera);
    const box = this.renderer.domElement.getBoundingClientRect();
    return { x: box.left + ((seen.x + 1) / 2) * box.width, y: box.top + ((1 - seen.y) / 2) * box.height };
  }

  /** The view as a PNG at twice its size, with the words over it. */
  picture(): Promise<Blob | null> {
    const before = this.now;
    this.renderer.setPixelRatio(2);
    this.render();
    const canvas = document.createElement("canvas");
    canvas.width = this.renderer.domElement.width;
    canvas.height = this.renderer.domElement.height;
    const context = canvas.getContext("2d")!;
    context.drawImage(this.renderer.domElement, 0, 0);
    this.renderer.setPixelRatio(before);
    this.wake();
    context.scale(2, 2);
    context.font = "600 11.5px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const { line } of this.said) {
      if (!line) continue;
      context.strokeStyle = "#23262b";
      context.beginPath();
      context.moveTo(line[0], line[1]);
      context.lineTo(line[2], line[3]);
      context.stroke();
    }
    for (const { x, y, text, kind } of this.said) {
      const wide = context.measureText(text).width + 12;
      context.fillStyle = { good: "#0b7a5c", bad: "#c2332b", chosen: "#1e2126", lit: "#ffd479", name: "rgb(255 255 255 / 84%)", axis: "rgb(255 255 255 / 0%)" }[kind];
      context.beginPath();
      context.roundRect(x - wide / 2, y - 9, wide, 18, 6);
      context.fill();
      context.fillStyle = kind === "name" || kind === "lit" || kind === "axis" ? "#23262b" : "#fff";
      context.fillText(text, x, y);
    }
    return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  }

  stop(): void {
    this.running = false;
    this.controls.dispose();
    this.dispose();
  }
}
