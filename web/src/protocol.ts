// The studio's protocol as types (docs/reference/studio.md), and its binary frames.

/** Names one trace: a session's, or one of a run's. */
export interface State {
  session?: number;
  run?: string;
  draw?: number;
  film?: number;
  mode?: number;
}

export interface Diagnostic {
  file: string;
  line: number;
  column: number;
  end_line: number;
  end_column: number;
  severity: string;
  message: string;
  hint?: string | null;
}

export interface Program {
  file: string;
  shipped: boolean;
  about: string | null;
  /** The photograph that comes with a shipped program. */
  example?: string | null;
}

export interface Folder {
  version: string;
  folder: string;
  programs: Program[];
  pictures: string[];
  /** The photographs that come with pcadlang. */
  examples: string[];
  runs: Run[];
  evaluations: string[];
  sessions: number[];
}

/** A position in a photograph, pixels. */
export type Point = [number, number];

/** Where the object is, in pixels of the photograph. */
export interface Hint {
  mask: string | null;
  outline: Point[];
  box: [number, number, number, number] | null;
  axis: { foot: Point; top: Point; width: number } | null;
  at: Point[];
  not: Point[];
}

/** The place that a hint points out: guesses of its outline, each of some polygons, the best
 * first. */
export interface Guess {
  source: string;
  score: number;
  box: [number, number, number, number] | null;
  outlines: Point[][][];
}

/** A `data` item of a program. */
export interface Data {
  name: string;
  kind: string | null;
  given: boolean;
}

/** A program that cannot be opened until its data are given. */
export interface Wanting {
  session: null;
  program: string;
  text: string;
  data: Data[];
}

export interface Session {
  session: number;
  program: string;
  text: string;
  note: string | null;
  observe: string[];
  hint: Hint;
  photo: { name: string; width: number; height: number } | null;
  data: Data[];
  params: { name: string; value: unknown; about?: string | null }[];
  revision: number;
  log_joint: number | null;
  /** The state is a draw from the prior that nobody changed. */
  is_prior: boolean;
  undo: string | null;
  redo: string | null;
  has_view: boolean;
  presets: { name: string; about: string }[];
}

export type Value = number | boolean | string | null | Value[];

export interface Choice {
  address: string;
  value: Value;
  text: string;
  family: string;
  log_density: number | null;
  support: string | null;
  low: number | null;
  high: number | null;
  scale: number | null;
  tags: string[];
  forced: boolean;
  frozen: boolean;
  acceptance: number | null;
}

export interface Densities {
  log_joint: number | null;
  log_prior: number | null;
  log_likelihood: number | null;
}

/** What a change in a drag answers. */
export interface Moved extends Densities {
  revision: number;
}

/** A landmark of the scene, pixels of the picture. */
export interface Joint {
  name: string;
  at: Point;
}

/** The landmarks of the scene, in a picture of this size. */
export interface Joints {
  width: number;
  height: number;
  joints: Joint[];
}

export interface Choices extends Densities {
  total: number;
  choices: Choice[];
  observed: { address: string; log_density: number | null }[];
}

export type RunState =
  | "waiting"
  | "running"
  | "paused"
  | "stopping"
  | "done"
  | "stopped"
  | "failed"
  | "interrupted";

export interface Run {
  run: string;
  folder: string;
  program: string;
  observe: string[];
  set: Record<string, string>;
  state: RunState;
  phase: string | null;
  chains: number;
  ended: number;
  steps: number;
  elapsed: number;
  left: number | null;
  done: number | null;
  best: number | null;
  revision: number;
  draws: number;
  film: number | null;
  error: string | null;
  begun: string | null;
  r_hat: number | null;
  /** Whether the object of the photograph was found, in one sentence. */
  found: string | null;
  session: number | null;
}

export interface Settings {
  seed?: number;
  chains?: number;
  quality?: string;
  time?: number;
  steps?: number;
  set?: Record<string, string>;
}

export interface Draw {
  chain: number;
  draw: number;
  log_joint: number | null;
}

export interface Draws {
  draws: Draw[];
  /** The states on the way from the prior, of the chain that ended best. */
  film: { step: number; log_joint: number | null }[];
  chains: number;
}

/** The statistics of a quantity's posterior: mean, sd, quantiles, r_hat, ess_bulk and more. */
export type Statistics = Record<string, number | null>;

export interface Mode {
  chains?: number[];
  share?: number;
  probability?: number | null;
  log_joint?: number | null;
  /** With its standard error. */
  log_evidence?: [number, number] | null;
  [more: string]: unknown;
}

export interface Summary {
  modes: Mode[];
  warnings: string[];
  approximate: string[];
  choices: Record<string, unknown>[];
  quantities: Record<string, Statistics>;
  files: string[];
  command: string | null;
}

export interface Quantity {
  name: string;
  chains: (number | null)[][];
}

export interface Comparison {
  settings: { a: string[]; b: string[] };
  same_program: boolean;
  same_data: boolean;
  quantities: { name: string; a: Statistics | null; b: Statistics | null; apart: number | null }[];
}

export interface Case {
  name: string;
  state: string;
  error: string | null;
  picture: string | null;
  overlay: string | null;
  score: number | null;
  r_hat: number | null;
  seconds: number | null;
  doubt: number | null;
}

export interface Reply {
  text: string;
  picture: boolean;
  clears: boolean;
  confirm: { question: string; then: string } | null;
}

export type Vec3 = [number, number, number];

/** A camera of the protocol: `height` instead of `fov_y` makes it orthographic. */
export interface Camera {
  eye: Vec3;
  target: Vec3;
  up: Vec3;
  fov_y?: number | null;
  height?: number | null;
  width_px?: number;
  height_px?: number;
  near?: number;
  far?: number;
  /** Where the camera's axis meets the picture: from its centre, in parts of its sides. */
  shift?: [number, number];
}

export type Event =
  | { event: "run"; run: Run }
  | { event: "session"; session: number; revision: number }
  | { event: "opened"; session: number; program: string }
  | { event: "closed"; session: number }
  | { event: "folder" };

/** The layers of pictures, with their names. */
export const LAYERS: [string, string][] = [
  ["overlay", "Overlay"],
  ["photo", "Photograph"],
  ["scene", "Scene"],
  ["depth", "Depth"],
  ["normals", "Normals"],
  ["regions", "Parts"],
  ["contours", "Contours of the scene"],
  ["photo_contours", "Contours of the photograph"],
  ["residuals", "Residuals"],
  ["joints", "Joints"],
  ["mask", "Mask"],
];

/** A triangle mesh; meshes with the same topology have corresponding vertices. */
export interface Mesh {
  topology: string;
  parts: string[];
  positions: Float32Array;
  normals: Float32Array | null;
  corners: Uint32Array;
  partOf: Uint16Array | null;
}

export interface BinaryHeader {
  id: number;
  type: string;
  width?: number;
  height?: number;
  log_joint?: number | null;
  revision?: number;
  vertices?: number;
  triangles?: number;
  topology?: string;
  parts?: string[];
}

export interface BinaryAnswer {
  header: BinaryHeader;
  data: Uint8Array;
}

/** Splits a binary frame into its header and its data. */
export function readFrame(frame: ArrayBuffer): BinaryAnswer {
  if (frame.byteLength < 4) throw new Error("a binary frame is shorter than its length field");
  const length = new DataView(frame).getUint32(0, true);
  if (4 + length > frame.byteLength) throw new Error("a binary frame is shorter than its header");
  const text = new TextDecoder().decode(new Uint8Array(frame, 4, length));
  return { header: JSON.parse(text) as BinaryHeader, data: new Uint8Array(frame, 4 + length) };
}

/** Reads the mesh of a binary answer. */
export function readMesh({ header, data }: BinaryAnswer): Mesh {
  const n = header.vertices ?? 0;
  const m = header.triangles ?? 0;
  const bytes = 24 * n + 12 * m + 2 * m;
  if (data.byteLength < bytes) {
    throw new Error(`a mesh of ${n} vertices has ${data.byteLength} bytes instead of ${bytes}`);
  }
  // Typed arrays must begin at multiples of their element's size, which the header's length
  // does not promise: the data is copied to its own buffer.
  const buffer = data.slice().buffer;
  return {
    topology: header.topology ?? "",
    parts: header.parts ?? [],
    positions: new Float32Array(buffer, 0, 3 * n),
    normals: new Float32Array(buffer, 12 * n, 3 * n),
    corners: new Uint32Array(buffer, 24 * n, 3 * m),
    partOf: new Uint16Array(buffer, 24 * n + 12 * m, m),
  };
}

/** A choice with what the program leaves out where there is nothing to say. */
export function wholeChoice(choice: Partial<Choice> & Pick<Choice, "address" | "value">): Choice {
  return {
    text: String(choice.value),
    family: "",
    log_density: null,
    support: null,
    low: null,
    high: null,
    scale: null,
    tags: [],
    forced: false,
    frozen: false,
    acceptance: null,
    ...choice,
  };
}

/** The name of a run as the user reads it: where all runs lie goes without saying. */
export function runName(run: string): string {
  return run.replace(/^runs\//, "");
}

/** True if a run has a best state, whose picture can be asked for. */
export function hasBest(run: Run | null): boolean {
  return run !== null && (run.revision > 0 || run.draws > 0);
}

/** True if a run still works or waits, so that it can be stopped. */
export function isLive(run: Run): boolean {
  return ["waiting", "running", "paused", "stopping"].includes(run.state);
}

/** True if a run that does not work at present can go on. */
export function canGoOn(run: Run): boolean {
  return ["paused", "stopped", "interrupted"].includes(run.state);
}

/** The `data` item that a photograph is for. */
export function imageItem(data: Data[]): Data | null {
  return data.find((d) => d.kind === "image") ?? null;
}
