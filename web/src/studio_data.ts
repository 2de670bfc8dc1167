// The states that the studio shows, of the session or of the run that is looked at, and the
// viewer's data of them.

import type { Known } from "./actions";
import type { Connection } from "./connection";
import { hasBest, LAYERS, readMesh, type Camera, type Mesh, type State } from "./protocol";
import type { Frame, ImageUrl, ViewerData } from "./viewer";

const OF_PHOTOGRAPHS = ["overlay", "photo", "photo_contours", "residuals"];

/** The states of the chosen view, each with its place on the viewer's slider. */
export function statesOf(known: Readonly<Known>): [Frame, State][] {
  const { view, run, session, draws, modes } = known;
  const plain = (label: string, logJoint: number | null = null): Frame => {
    return { label, chain: null, step: null, logJoint };
  };
  const several = (total: number, make: (i: number) => [Frame, State]) => {
    return Array.from({ length: total }, (_, i) => make(i));
  };
  if (view === "session") {
    if (!session) return [];
    const label = session.is_prior ? "A draw from the prior" : "The session's state";
    return [[plain(label, session.log_joint), { session: session.session }]];
  }
  if (run === null) return [];
  if (view === "film") {
    return (draws?.film ?? []).map(({ step, log_joint }, film) => [
      { label: `Step ${step.toLocaleString("en")}`, chain: null, step, logJoint: log_joint },
      { run, film },
    ]);
  }
  if (view === "modes") return several(modes, (mode) => [plain(`Mode ${mode + 1}`), { run, mode }]);
  if (view === "draws") {
    return (draws?.draws ?? []).map((d, draw) => [
      { label: `Chain ${d.chain}, draw ${d.draw}`, chain: d.chain, step: d.draw, logJoint: d.log_joint },
      { run, draw },
    ]);
  }
  // A run that just began, or failed, has no state yet.
  const current = known.runs.find((r) => r.run === run) ?? null;
  return hasBest(current) ? [[plain("The best state so far"), { run }]] : [];
}

/** The view with several states to which the timeline leads while the best one is shown. */
export function timelineOf(known: Readonly<Known>): "draws" | "film" | null {
  if (known.view !== "best") return null;
  if ((known.draws?.draws.length ?? 0) > 1) return "draws";
  return (known.draws?.film.length ?? 0) > 1 ? "film" : null;
}

/** The state that is shown at present. */
export function stateOf(known: Readonly<Known>): State | null {
  const states = statesOf(known);
  return states[Math.min(known.at ?? 0, states.length - 1)]?.[1] ?? null;
}

/** The states of the chosen view, as frames of the viewer. */
export class StudioData implements ViewerData {
  readonly layers: string[];
  readonly photoKey: string | null;
  readonly viewpoints = true;
  readonly pictureNote = null;
  readonly key: string;
  readonly frames: Frame[];
  readonly drawCount: number;
  private readonly run: string | null;
  private readonly states: State[];
  private readonly photoState: State | null;

  constructor(
    private readonly connection: Pick<Connection, "ask" | "askBinary">,
    known: Readonly<Known>,
  ) {
    const { view, run, session, draws } = known;
    const current = known.runs.find((r) => r.run === run) ?? null;
    // Pictures of a program without a scene would be errors.
    const ofSession = view === "session" || current?.session === session?.session;
    const shown = session && ofSession && !session.has_view ? [] : statesOf(known);
    this.frames = shown.map(([frame]) => frame);
    this.states = shown.map(([, state]) => state);
    // Another photograph changes the pictures of a session's states, another run its ghosts.
    const data = view === "session" ? JSON.stringify([session?.observe, run]) : "";
    this.key = `${view} ${view === "session" ? session?.session : run} ${data}`;
    this.drawCount = run === null ? 0 : (draws?.draws.length ?? 0);
    this.run = run;
    const ofRun = current?.observe ?? [];
    const observed = view === "session" ? (session?.observe ?? []) : ofRun;
    const hasPhoto = view === "session" ? Boolean(session?.photo) : ofRun.length > 0;
    this.photoKey = hasPhoto ? JSON.stringify(observed) : null;
    // A session answers sooner than a run that is at work.
    const same = session?.photo && JSON.stringify(session.observe) === this.photoKey;
    this.photoState = same ? { session: session.session } : null;
    const layers = LAYERS.map(([layer]) => layer);
    this.layers = hasPhoto ? layers : layers.filter((layer) => !OF_PHOTOGRAPHS.includes(layer));
  }

  async mesh(frame: number): Promise<Mesh> {
    return this.meshOf(this.states[frame]!);
  }

  async drawMesh(draw: number): Promise<Mesh> {
    return this.meshOf({ run: this.run!, draw });
  }

  async camera(frame: number): Promise<Camera | null> {
    return this.connection.ask<Camera>("camera", { state: this.states[frame]! });
  }

  async photo(): Promise<ImageUrl | null> {
    const state = this.photoState ?? this.states[0];
    if (!state) return null;
    try {
      return await askPicture(this.connection, state, "photo", 1024);
    } catch {
      // A program without a photograph has no such layer, and the 3D view does without.
      return null;
    }
  }

  async picture(frame: number, layer: string, size: number, camera?: Camera): Promise<ImageUrl> {
    return askPicture(this.connection, this.states[frame]!, layer, size, camera);
  }

  private async meshOf(state: State): Promise<Mesh> {
    return readMesh(await this.connection.askBinary("mesh", { state }));
  }
}

/** Asks for the picture of a state. */
export async function askPicture(
  connection: Pick<Connection, "askBinary">,
  state: State,
  layer: string,
  size: number,
  camera?: Camera,
): Promise<ImageUrl> {
  const params = { state, layer, size, ...(camera ? { camera } : {}) };
  const { header, data } = await connection.askBinary("picture", params);
  const url = URL.createObjectURL(new Blob([data.slice()], { type: header.type }));
  return { url, owned: true };
}
