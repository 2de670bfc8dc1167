// The data of a notebook's viewer: one solid, whose bytes the kernel sends.

import type { Camera, Mesh } from "./protocol";
import type { Frame, ImageUrl, ViewerData } from "./viewer";

/** The widget's model in the page, as anywidget gives it. */
export interface WidgetModel {
  get(name: "vertices" | "triangles" | "picture"): DataView;
  on(event: string, listener: () => void): void;
  off(event: string, listener: () => void): void;
}

/** The solid of a widget. */
export class NotebookData implements ViewerData {
  // Another solid is shown from where the user turned the view.
  readonly key = "solid";
  readonly frames: Frame[] = [{ label: "The solid", chain: null, step: null, logJoint: null }];
  readonly layers: string[];
  readonly viewpoints = false;
  readonly pictureNote = "from the front";
  readonly drawCount = null;
  readonly photoKey = null;

  /** A page without WebGL shows the kernel's picture instead of the mesh. */
  constructor(
    private readonly model: WidgetModel,
    has3D: boolean,
  ) {
    this.layers = has3D ? [] : ["scene"];
  }

  async mesh(): Promise<Mesh> {
    return {
      topology: "",
      parts: [],
      positions: new Float32Array(this.bytes("vertices")),
      normals: null,
      corners: new Uint32Array(this.bytes("triangles")),
      partOf: null,
    };
  }

  drawMesh(): Promise<Mesh> {
    return this.mesh();
  }

  async camera(): Promise<Camera | null> {
    return null;
  }

  async photo(): Promise<ImageUrl | null> {
    return null;
  }

  async picture(): Promise<ImageUrl> {
    const blob = new Blob([this.bytes("picture")], { type: "image/png" });
    return { url: URL.createObjectURL(blob), owned: true };
  }

  // Bytes from the kernel may lie at any offset of their buffer; typed arrays need multiples of 4.
  private bytes(name: "vertices" | "triangles" | "picture"): ArrayBuffer {
    const view = this.model.get(name);
    return view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength) as ArrayBuffer;
  }
}
