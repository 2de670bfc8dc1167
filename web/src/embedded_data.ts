// The data of a report's viewer: draws and pictures that lie in the page as JSON.

import { inflate } from "./inflate";
import type { Camera, Mesh } from "./protocol";
import type { Frame, ImageUrl, ViewerData } from "./viewer";

/** A draw as the report holds it. */
interface EmbeddedDraw {
  chain: number | null;
  draw: number | null;
  log_joint: number | null;
  label: string | null;
  topology: string;
  positions: string;
}

/** The JSON of a report. */
export interface EmbeddedScene {
  camera: Camera | null;
  photo: string | null;
  topologies: Record<string, string>;
  low: number[];
  high: number[];
  draws: EmbeddedDraw[];
  layers: Record<string, string>;
}

/** Positions from their differences: all x, then all y, then all z, of 16 bits each. */
function readPositions(bytes: Uint8Array, low: number[], high: number[]): Float32Array {
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const n = Math.floor(bytes.byteLength / 6);
  const positions = new Float32Array(3 * n);
  for (let axis = 0; axis < 3; axis++) {
    const from = low[axis]!;
    const step = (high[axis]! - from) / 65535;
    let q = 0;
    for (let i = 0; i < n; i++) {
      q = (q + data.getUint16(2 * (axis * n + i), true)) & 0xffff;
      positions[3 * i + axis] = from + q * step;
    }
  }
  return positions;
}

/** The corners of triangles, of 32 bits each. */
function readCorners(bytes: Uint8Array): Uint32Array {
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = Math.floor(bytes.byteLength / 4);
  return Uint32Array.from({ length: count }, (_, i) => data.getUint32(4 * i, true));
}

/** The draws and pictures of a report. */
export class EmbeddedData implements ViewerData {
  readonly key = "report";
  readonly frames: Frame[];
  readonly layers: string[];
  readonly viewpoints = false;
  readonly pictureNote = "the best state";
  readonly drawCount: number;
  readonly photoKey: string | null;
  private readonly corners = new Map<string, Promise<Uint32Array>>();
  private readonly meshes = new Map<number, Promise<Mesh>>();

  constructor(private readonly scene: EmbeddedScene) {
    this.frames = scene.draws.map((draw, i) => ({
      label: draw.label ?? `Draw ${draw.draw ?? i}`,
      chain: draw.chain,
      step: draw.draw,
      logJoint: draw.log_joint,
    }));
    this.layers = Object.keys(scene.layers);
    this.drawCount = scene.draws.length;
    this.photoKey = scene.photo ? "photo" : null;
  }

  mesh(frame: number): Promise<Mesh> {
    let mesh = this.meshes.get(frame);
    if (!mesh) this.meshes.set(frame, (mesh = this.readMesh(frame)));
    return mesh;
  }

  drawMesh(draw: number): Promise<Mesh> {
    return this.mesh(draw);
  }

  async camera(): Promise<Camera | null> {
    return this.scene.camera;
  }

  async photo(): Promise<ImageUrl | null> {
    const url = this.scene.photo;
    return url ? { url, owned: false } : null;
  }

  async picture(_frame: number, layer: string): Promise<ImageUrl> {
    const url = this.scene.layers[layer];
    if (!url) throw new Error(`the report has no picture \`${layer}\``);
    return { url, owned: false };
  }

  private async readMesh(frame: number): Promise<Mesh> {
    const { scene } = this;
    const draw = scene.draws[frame]!;
    let corners = this.corners.get(draw.topology);
    if (!corners) {
      const packed = scene.topologies[draw.topology];
      if (packed === undefined) throw new Error(`the report lacks the triangles of draw ${frame}`);
      corners = inflate(packed).then(readCorners);
      this.corners.set(draw.topology, corners);
    }
    return {
      topology: draw.topology,
      parts: [],
      positions: readPositions(await inflate(draw.positions), scene.low, scene.high),
      normals: null,
      corners: await corners,
      partOf: null,
    };
  }
}
