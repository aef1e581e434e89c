// What the server sends. Lengths are metres, angles radians; a pose is [x, y, theta].
export type Pose = [number, number, number];
export type Point = [number, number];

export interface Footprint {
  kind: "circle" | "box" | "polygon";
  radius?: number;
  corners?: Point[];
}

export interface Thing {
  name: string;
  asset: string;
  footprint: Footprint;
  height: number;
  color: [number, number, number];
  says: string;
  mesh: string;
  fixed: Pose | null;
  surfaces: string[]; // what it is declared to stand on: one of these in each scene
  ring: Ring | null; // of a robot: what it reaches at the table
}

export interface Ring {
  nearest: number;
  farthest: number;
  bearing: [number, number] | null; // from the robot's heading; null: all round
}

/** What a camera pictures of the table; an eye that is outside stands where the view ends. */
export interface CameraFrame {
  name: string;
  corners: Point[];
  eye: Pose;
  outside: boolean;
}

/** The share of an object that a camera sees; in words also whether all of it is in the picture. */
export interface Seen {
  camera: string;
  thing: number;
  share: number;
  words: string;
}

/** An open hand over an object, in its frame: two fingers and the palm. */
export interface Hand {
  thing: number;
  robot: number;
  yaw: number;
  room: number;
  boxes: Point[][];
}

/** Where things usually are that have the same prior, given where the others stand: drawn within a box. */
export interface UsualPlace {
  things: number[];
  within: [number, number, number, number];
  discs: { middle: Point; inner: number; outer: number; share: number }[]; // half is in the inner circle, nine tenths in the outer one
  areas: { corners: Point[]; share: number }[];
  dots: Point[];
}

export interface Region {
  name: string;
  footprint: Footprint;
  pose: Pose;
  color: [number, number, number];
  height: number; // of a board; 0 where the region lies on the table
  board: [number, number, number];
}

export interface Line {
  line: number;
  kind: "all" | "one" | "atom" | "time";
  text: string;
  margin: string;
  unit: string;
  count: string;
  bounds: [number | null, number | null];
  spans: [number, number][];
  parts: Line[];
  more?: number;
}

export interface Spec {
  sha256: string;
  source: string;
  title: string;
  workspace: { x: [number, number]; y: [number, number] };
  table: [number, number, number, number];
  thickness: number;
  tall: number;
  numbers?: Count[]; // what it draws the number of; the rest of this is of the spec with these numbers
  objects: Thing[];
  regions: Region[];
  cameras: CameraFrame[];
  labels: { name: string; bounds: [number, number] }[];
  requires: boolean;
  trees: Record<string, Line>;
  time: { steps: number; dt: number; moves: "one" | "all" } | null; // of a spec over time
  most: number; // scenes, or motions, that the page shows
}

export type Mark =
  | { kind: "line"; start: Point; end: Point; text: string; good: boolean }
  | { kind: "turn"; center: Point; from: number; to: number; text: string; good: boolean }
  | { kind: "guide"; start: Point; end: Point };

export interface Decides {
  text: string;
  spans: [number, number][];
  value: number;
  lines: number[];
  marks: Mark[];
  required: boolean;
  unit: string; // of its value
  settled?: boolean; // no move of an object changes it: it depends on the surfaces that objects stand on
  keeper?: Decides; // another one that is phi, and that no move changes
  moment?: number; // of a motion: the moment that decides
  signal?: (number | null)[]; // and the atom's margin at every moment
}

export interface Report {
  phi: Record<string, number[]>;
  require: number[] | null;
  bases: number[][];
  on?: number[][] | null; // for each object with several surfaces the number of its surface, from 1
  values?: (number | null)[];
  decides?: Record<string, Decides | null>;
  signals?: Record<string, (number | null)[]>; // of a motion: phi from every moment on
  at?: number[]; // of a motion, by line: the moment at which its value counts
  over?: (number | null)[][] | null; // and its value at every moment
  overlaps?: [string, string][];
  seen?: Seen[];
  hands?: Hand[];
  usual?: UsualPlace[];
}

export interface Result extends Report {
  poses: Pose[][];
  motions?: Pose[][][]; // of a spec over time: the poses of each motion, moment by moment; `poses` are the last ones
  rises?: number[][][] | null; // and how high above the table objects stand; null where all stand on it
  sampler: Record<string, unknown>;
  warnings: { code: string; title: string }[]; // code: "" of what no diagnostic says
  together?: number; // so many scenes belong together: 2 of a pair, its start and its goal
  notes: string[];
  took: number;
}

export type Ends = [number | null, number | null];

/** How many of something there are, of a spec that draws it; of an object of a category, which asset it is. */
export interface Count {
  name: string;
  least: number;
  most: number;
  now: number;
  assets: string[];
}

export interface Request {
  counts?: Record<string, number>;
  phi: Record<string, Ends>;
  n: number;
  seed: number;
  method: string;
  spread: string;
  fix: Record<string, Pose>;
}

export interface Rarity {
  label: string;
  bounds: [number, number];
  reached: [number, number];
  curve: [number, number | null, number | null][];
  bands: { name: string; low: number; high: number; log10: number | null }[];
  whole: [boolean, boolean];
}

export interface Refusal {
  code?: string;
  title: string;
  label: string;
  note: string;
  help: string;
  text: string;
  span?: [number, number];
}

export interface Problem {
  range: { start: { line: number; character: number }; end: { line: number; character: number } };
  message: string;
  code?: string;
  severity: number;
}

export interface PackedMesh {
  scale: number;
  position: string;
  normal: string;
  color: string;
  index: string;
  wide: boolean;
}

/** What was written and not saved; `was` is the hash of the file that it began with. */
export interface Draft {
  text: string;
  was: string | null;
  tab: string; // in which it was written
}

export interface Boot {
  text: string;
  name: string;
  path: string | null;
  sha: string | null;
  shipped?: string | null; // the name of the example that it is
  folder: string;
  where: string; // the folder, as seen from the one that the server was started in
  model: string | null;
  scenes: Result | null;
  parts: { counts: Record<string, number>; scenes: Result }[]; // of a file: its scenes of other numbers of things
  request: Partial<Request>;
  draft?: Draft | null; // of what is opened: what was written in it and not saved
  welcome: boolean; // nothing was named: the examples are the first screen
  methods: { name: string; motions: boolean; model: boolean }[]; // of sampling: whether they draw motions, and need a model
  formats: { name: string; title: string; motions: boolean; install: string | null }[]; // `install`: of a library that is missing
  // only in a page without a server
  alone?: {
    spec: Spec;
    meshes: Record<string, PackedMesh>;
    rarity: Rarity[];
    reports: { values: (number | null)[]; decides: Record<string, Decides | null>; overlaps: [string, string][]; seen?: Seen[]; hands?: Hand[]; usual?: UsualPlace[] }[];
    command: string;
    file: object; // the head of a file of the scenes, as scenegen writes it
  };
}
