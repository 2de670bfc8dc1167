// Where the viewer gets what it shows: in the studio from the program, in a report from data
// that lie in the page.

import type { Camera, Mesh } from "./protocol";

/** One place of the viewer's slider. */
export interface Frame {
  label: string;
  chain: number | null;
  logJoint: number | null;
}

/** A picture, and the address under which the page can show it. */
export interface Picture {
  url: string;
  /** Whether `url` must be revoked when it is no longer shown. */
  owned: boolean;
  logJoint: number | null;
}

/** The scenes to view: a list of frames, with their meshes and pictures. */
export interface Source {
  /** Changes when the frames mean something else. */
  readonly key: string;
  readonly frames: Frame[];
  /** Layers that pictures have; empty: no pictures. */
  readonly layers: string[];
  /** Whether any frame can be rendered from another viewpoint. */
  readonly viewpoints: boolean;
  /** What the pictures show where they do not follow the frames; otherwise null. */
  readonly pictureNote: string | null;
  /** How many posterior draws there are, for ghosts and uncertainty. */
  readonly drawCount: number;
  /** Which photograph is behind the scenes; null: none. */
  readonly photoKey: string | null;
  mesh(frame: number): Promise<Mesh>;
  drawMesh(draw: number): Promise<Mesh>;
  camera(frame: number): Promise<Camera | null>;
  photo(): Promise<Picture | null>;
  picture(frame: number, layer: string, size: number, camera?: Camera): Promise<Picture>;
}
