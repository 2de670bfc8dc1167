// What the studio's viewer shows: states of the session or of the run that is looked at.

import type { Connection } from "./connection";
import type { Camera, Mesh, State } from "./protocol";
import { hasBest, readMesh } from "./protocol";
import type { Frame, Picture, Source } from "./source";
import type { Known } from "./store";

const LAYERS = [
  "overlay",
  "photo",
  "scene",
  "depth",
  "normals",
  "regions",
  "contours",
  "photo_contours",
  "residuals",
  "joints",
  "mask",
];

const OF_PHOTOGRAPHS = ["overlay", "photo", "photo_contours", "residuals"];

/** The states of the chosen view, as frames of the viewer. */
export class SocketSource implements Source {
  readonly layers: string[];
  readonly photoKey: string | null;
  readonly viewpoints = true;
  readonly pictureNote = null;
  readonly key: string;
  readonly frames: Frame[];
  readonly drawCount: number;
  private readonly states: State[];
  private readonly photoState: State | null;

  constructor(
    private readonly connection: Connection,
    known: Readonly<Known>,
  ) {
    const { view, run, session, draws } = known;
    const listed = framesOf(known);
    this.frames = listed.map(([frame]) => frame);
    this.states = listed.map(([, state]) => state);
    // Another photograph changes the pictures of a session's states, whatever its number.
    const data = view === "session" ? JSON.stringify(session?.observe) : "";
    this.key = `${view} ${view === "session" ? session?.session : run} ${data}`;
    this.drawCount = run === null ? 0 : (draws?.draws.length ?? 0);
    this.run = run;
    const ofRun = known.runs.find((r) => r.run === run)?.observe ?? [];
    const observed = view === "session" ? (session?.observe ?? []) : ofRun;
    const hasPhoto = view === "session" ? Boolean(session?.photo) : ofRun.length > 0;
    this.photoKey = hasPhoto ? JSON.stringify(observed) : null;
    // A session answers sooner than a run that is at work.
    const same = session?.photo && JSON.stringify(session.observe) === this.photoKey;
    this.photoState = same ? { session: session.session } : null;
    this.layers = hasPhoto ? LAYERS : LAYERS.filter((layer) => !OF_PHOTOGRAPHS.includes(layer));
  }

  private readonly run: string | null;

  async mesh(frame: number): Promise<Mesh> {
    return this.meshOf(this.states[frame]!);
  }

  async drawMesh(draw: number): Promise<Mesh> {
    return this.meshOf({ run: this.run!, draw });
  }

  async camera(frame: number): Promise<Camera | null> {
    return this.connection.ask<Camera>("camera", { state: this.states[frame]! });
  }

  async photo(): Promise<Picture | null> {
    const state = this.photoState ?? this.states[0];
    if (!state) return null;
    try {
      return await askPicture(this.connection, state, "photo", 1024);
    } catch {
      // A program without a photograph has no such layer, and the 3D view does without.
      return null;
    }
  }

  async picture(frame: number, layer: string, size: number, camera?: Camera): Promise<Picture> {
    return askPicture(this.connection, this.states[frame]!, layer, size, camera);
  }

  private async meshOf(state: State): Promise<Mesh> {
    return readMesh(await this.connection.askBinary("mesh", { state }));
  }
}

/** Asks for the picture of a state. */
export async function askPicture(
  connection: Connection,
  state: State,
  layer: string,
  size: number,
  camera?: Camera,
): Promise<Picture> {
  const params = { state, layer, size, ...(camera ? { camera } : {}) };
  const { header, data } = await connection.askBinary("picture", params);
  const url = URL.createObjectURL(new Blob([data.slice()], { type: header.type }));
  return { url, owned: true, logJoint: header.log_joint ?? null };
}

function framesOf(known: Readonly<Known>): [Frame, State][] {
  const { view, run, session, draws, modes } = known;
  const plain = (label: string, logJoint: number | null = null): Frame => {
    return { label, chain: null, logJoint };
  };
  if (view === "session") {
    if (!session?.has_view) return [];
    return [[plain("The session's state", session.log_joint), { session: session.session }]];
  }
  if (run === null) return [];
  const current = known.runs.find((r) => r.run === run) ?? null;
  // Pictures of a program without a scene would be errors.
  if (session && current?.session === session.session && !session.has_view) return [];
  if (view === "best") {
    // A run that just began, or failed, has no state yet.
    return hasBest(current) ? [[plain("The best state so far"), { run }]] : [];
  }
  if (view === "modes") {
    return Array.from({ length: modes }, (_, mode) => [plain(`Mode ${mode + 1}`), { run, mode }]);
  }
  if (view === "film") {
    const n = draws?.film ?? 0;
    const label = "From prior to posterior";
    return Array.from({ length: n }, (_, film) => [plain(label), { run, film }]);
  }
  return (draws?.draws ?? []).map((d, draw) => [
    { label: `Chain ${d.chain}, draw ${d.draw}`, chain: d.chain, logJoint: d.log_joint },
    { run, draw },
  ]);
}
