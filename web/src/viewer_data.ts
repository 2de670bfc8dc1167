// Where the viewer gets what it shows: in the studio from the program, in a report from data
// that lie in the page, in a notebook from the kernel.

import type { Camera, Mesh } from "./protocol";

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

/** One place of the viewer's slider. */
export interface Frame {
  label: string;
  chain: number | null;
  logJoint: number | null;
}

/** The address under which the page can show a picture. */
export interface ImageUrl {
  url: string;
  /** True if `url` must be revoked when it is no longer shown. */
  owned: boolean;
}

/** The scenes to view: a list of frames, with their meshes and pictures. */
export interface ViewerData {
  /** Changes when the frames mean something else. */
  readonly key: string;
  readonly frames: Frame[];
  /** Layers that pictures have; empty: no pictures. */
  readonly layers: string[];
  /** True if frames can be rendered from another viewpoint. */
  readonly viewpoints: boolean;
  /** Shown beside pictures that do not follow the frames; otherwise null. */
  readonly pictureNote: string | null;
  /** The number of posterior draws, for ghosts and uncertainty; null: never any. */
  readonly drawCount: number | null;
  /** Identifies the photograph behind the scenes; null: none. */
  readonly photoKey: string | null;
  mesh(frame: number): Promise<Mesh>;
  drawMesh(draw: number): Promise<Mesh>;
  camera(frame: number): Promise<Camera | null>;
  photo(): Promise<ImageUrl | null>;
  picture(frame: number, layer: string, size: number, camera?: Camera): Promise<ImageUrl>;
}
