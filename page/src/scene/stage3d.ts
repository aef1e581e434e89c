// A table with objects in three dimensions: what the large view and the small pictures share.
import { AmbientLight, BoxGeometry, Color, DirectionalLight, Group, HemisphereLight, InstancedMesh, Matrix4, Mesh, MeshLambertMaterial, MeshStandardMaterial, Object3D, PCFShadowMap, PerspectiveCamera, Scene, SRGBColorSpace, Vector3, WebGLRenderer, type Texture } from "three";
import type { PackedMesh, Point, Pose, Spec, Thing } from "../types";
import { geometryOf, prism } from "./meshes";
import { woodTexture } from "./wood";

const HIDDEN = new Matrix4().makeScale(0, 0, 0);
const BOARD = 0.01; // metres: how thick a board is, as in pictures of `scenegen render`

export class Stage3d {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(32, 4 / 3, 0.02, 50);
  readonly renderer: WebGLRenderer;
  readonly objects = new Group(); // where each object is; it is not drawn itself
  readonly alike = new Group(); // what is drawn: all objects of one look at once
  private slots: [InstancedMesh, number][] = []; // of each object: its place there
  readonly boards = new Group();
  readonly sun = new DirectionalLight(0xfff1dd, 2.3);
  readonly center = new Vector3();
  side = 1;
  private table: Mesh | null = null;
  private material: MeshStandardMaterial | MeshLambertMaterial;
  private wood: Texture | null = null;
  spec: Spec | null = null;
  protected covered = { top: 0, bottom: 0 }; // shares of the picture's height that lie under something else

  constructor(canvas: HTMLCanvasElement, private small: boolean) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !small, alpha: true, preserveDrawingBuffer: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.material = small ? new MeshLambertMaterial({ vertexColors: true }) : new MeshStandardMaterial({ vertexColors: true, roughness: 0.62, metalness: 0 });
    this.camera.up.set(0, 0, 1);
    const sky = new HemisphereLight(0xffffff, 0xb49a80, 1.25);
    sky.position.set(0, 0, 1);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.radius = 4;
    this.sun.shadow.bias = -0.0006;
    this.sun.shadow.normalBias = 0.004;
    this.scene.add(sky, new AmbientLight(0xffffff, 0.35), this.sun, this.sun.target, this.boards, this.alike);
  }

  background(color: string | null): void {
    this.scene.background = color ? new Color(color) : null;
  }

  setSpec(spec: Spec, packed: Record<string, PackedMesh>): void {
    const sameTable = this.spec && JSON.stringify([spec.table, spec.workspace, spec.regions]) === JSON.stringify([this.spec.table, this.spec.workspace, this.spec.regions]);
    this.spec = spec;
    const [x0, y0, x1, y1] = spec.table;
    if (!sameTable) {
      const { x, y } = spec.workspace;
      this.side = Math.max(x[1] - x[0], y[1] - y[0]);
      this.center.set((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0);
      if (this.table) {
        this.scene.remove(this.table);
        this.table.geometry.dispose();
      }
      this.wood?.dispose();
      this.wood = woodTexture(spec, this.small ? 256 : devicePixelRatio > 1 ? 768 : 512);
      const edge = new MeshLambertMaterial({ color: 0x9a7650 });
      const top = new MeshLambertMaterial({ map: this.wood });
      this.table = new Mesh(new BoxGeometry(x1 - x0, y1 - y0, spec.thickness), [edge, edge, edge, edge, top, edge]);
      this.table.position.set((x0 + x1) / 2, (y0 + y1) / 2, -spec.thickness / 2);
      this.table.receiveShadow = true;
      this.scene.add(this.table);
      this.setBoards(spec);
      const reach = 0.95 * Math.max(x1 - x0, y1 - y0);
      this.sun.target.position.copy(this.center);
      this.sun.position.copy(this.center).add(new Vector3(-0.55, -0.35, 1.35).multiplyScalar(1.6 * this.side));
      const camera = this.sun.shadow.camera;
      Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * this.side, far: 6 * this.side });
      camera.updateProjectionMatrix();
    }
    this.setObjects(spec, packed);
    this.renderer.shadowMap.needsUpdate = true;
  }

  private setObjects(spec: Spec, packed: Record<string, PackedMesh>): void {
    for (const one of this.alike.children) (one as InstancedMesh).dispose();
    this.alike.clear();
    this.objects.clear();
    const looks = new Map<string, Thing[]>();
    for (const thing of spec.objects) {
      const place = new Object3D();
      place.name = thing.name;
      this.objects.add(place);
      if (!looks.get(thing.mesh)?.push(thing)) looks.set(thing.mesh, [thing]);
    }
    const slots = new Map<string, [InstancedMesh, number]>();
    for (const [look, things] of looks) {
      const mesh = new InstancedMesh(geometryOf(things[0], packed[look]), this.material, things.length);
      mesh.castShadow = true;
      mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      mesh.userData.names = things.map((one) => one.name);
      things.forEach((one, k) => slots.set(one.name, [mesh, k]));
      this.alike.add(mesh);
    }
    this.slots = spec.objects.map((one) => slots.get(one.name)!);
  }

  /** Regions at a height are boards, whose tops are there. */
  private setBoards(spec: Spec): void {
    for (const one of this.boards.children) {
      (one as Mesh).geometry.dispose();
      ((one as Mesh).material as MeshLambertMaterial).dispose();
    }
    this.boards.clear();
    for (const region of spec.regions) {
      if (!region.height) continue;
      const thick = Math.min(BOARD, region.height);
      const board = new Mesh(prism(region.footprint, thick), new MeshLambertMaterial({ color: new Color().setRGB(...region.board, SRGBColorSpace) }));
      board.position.set(region.pose[0], region.pose[1], region.height - thick);
      board.rotation.z = region.pose[2];
      board.castShadow = true;
      board.receiveShadow = true;
      this.boards.add(board);
    }
  }

  setPoses(poses: Pose[], bases: number[]): void {
    this.objects.children.forEach((place, at) => {
      const pose = poses[at], [mesh, slot] = this.slots[at];
      place.visible = !!pose;
      if (pose) {
        place.position.set(pose[0], pose[1], bases[at] ?? 0);
        place.rotation.z = pose[2];
        place.updateMatrix();
      }
      mesh.setMatrixAt(slot, pose ? place.matrix : HIDDEN);
      mesh.instanceMatrix.needsUpdate = true;
      mesh.boundingSphere = null; // what rays are compared with is computed anew
    });
    this.renderer.shadowMap.needsUpdate = true;
  }

  /** What the camera looks at: the middle of the table, higher where things stand on shelves. */
  middle(): Vector3 {
    const [x0, y0, x1, y1] = this.spec!.table;
    return new Vector3((x0 + x1) / 2, (y0 + y1) / 2, this.spec!.tall > 0.35 * this.side ? 0.4 * this.spec!.tall : 0);
  }

  /** Look at the whole table from in front of it. `close` moves nearer, for small pictures. */
  frame(aspect: number, close = 1): void {
    const spec = this.spec;
    if (!spec) return;
    const [x0, y0, x1, y1] = spec.table;
    const { tall, workspace } = spec;
    const target = this.middle();
    const direction = new Vector3(0, -0.8, tall > 0.35 * this.side ? 0.55 : aspect < 1.2 ? 1.25 : 0.95).normalize();
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    let low = 0.2 * this.side, high = 12 * this.side;
    const corners = [x0, x1].flatMap((x) => [y0, y1].flatMap((y) => [-spec.thickness, 0].map((z) => new Vector3(x, y, z))));
    corners.push(...workspace.x.flatMap((x) => workspace.y.map((y) => new Vector3(x, y, tall))));
    for (let round = 0; round < 24; round++) {
      const middle = (low + high) / 2;
      this.camera.position.copy(target).addScaledVector(direction, middle);
      this.camera.lookAt(target);
      this.camera.updateMatrixWorld();
      const fits = corners.every((corner) => {
        const seen = corner.clone().project(this.camera);
        return Math.abs(seen.x) <= 0.97 && seen.y <= 0.97 - 2 * this.covered.top && seen.y >= 2 * this.covered.bottom - 0.97;
      });
      if (fits) high = middle;
      else low = middle;
    }
    this.camera.position.copy(target).addScaledVector(direction, high / close);
    this.camera.lookAt(target);
  }

  render(): void {
    this.renderer.render(this.scene, this.camera);
  }

  dispose(): void {
    this.wood?.dispose();
    this.renderer.dispose();
  }
}

/** Where the axes begin: before the front left corner of the workspace, on the table. */
export function corner(spec: Spec): Point {
  const { x, y } = spec.workspace, [x0, y0] = spec.table;
  return [(x[0] + x0) / 2, (y[0] + y0) / 2];
}
