// The picture of a frame in one of its layers, with the viewpoint it is rendered from.

import { Disconnected, Latest } from "./connection";
import { h, select, setOptions } from "./dom";
import { ErrorBox, isWithoutScene } from "./errors";
import { LAYERS, type Camera, type Vec3 } from "./protocol";
import type { ImageUrl, ViewerData } from "./viewer";

const VIEWPOINTS: [string, string][] = [
  ["given", "From the camera"],
  ["view", "As in the 3D view"],
  ["left", "From the left"],
  ["right", "From the right"],
  ["above", "From above"],
  ["behind", "From behind"],
];

interface Request {
  frame: number;
  size: number;
}

/** Shows one frame's picture; while one is asked for, the one before stays. */
export class PictureView {
  readonly element: HTMLElement;
  readonly tools: HTMLElement;
  /** The camera of the 3D view, for pictures from there. */
  viewOf3D: () => Camera | null = () => null;
  /** Called when another layer or viewpoint is chosen. */
  readonly onLook: (() => void)[] = [];

  private data: ViewerData | null = null;
  private frame = 0;
  /** The layer that the user chose, and the one shown: not all data have every layer. */
  private wanted: string;
  private layer: string;
  private viewpoint = "given";
  /** The layer that is shown again after the photograph alone. */
  private behind: string | null = null;
  private shown: ImageUrl | null = null;
  private readonly image = h("img", { alt: "", draggable: "false" });
  private readonly empty = h("div", { class: "empty" }, "No picture yet");
  private readonly note = h("span", { class: "muted" });
  private readonly error = new ErrorBox();
  private readonly layers: HTMLSelectElement;
  private readonly viewpoints: HTMLSelectElement;
  private readonly work = new Latest<Request>((request) => this.load(request), (e) => this.fail(e));
  private fullTimer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    layer = "overlay",
    private readonly onLayer: (layer: string) => void = () => {},
  ) {
    this.wanted = this.layer = layer;
    this.layers = select([], layer, (value) => this.setLayer(value), { "aria-label": "Layer" });
    this.viewpoints = select(VIEWPOINTS, "given", (value) => this.setViewpoint(value), {
      "aria-label": "Viewpoint",
    });
    this.tools = h("div", { class: "tools" }, this.layers, this.viewpoints, this.note);
    this.element = h("div", { class: "picture" }, this.image, this.empty, this.error.element);
    this.image.hidden = true;
    // A picture asked for at another size is sharp again once the view's size is settled.
    new ResizeObserver(() => this.later(300)).observe(this.element);
  }

  /** Shows frames of other data. */
  setData(data: ViewerData | null): void {
    const other = data?.key !== this.data?.key;
    this.data = data;
    const known = data?.layers ?? [];
    if (known.length > 0) this.layer = known.includes(this.wanted) ? this.wanted : known[0]!;
    const options = LAYERS.filter(([key]) => known.includes(key));
    setOptions(this.layers, options, this.layer);
    this.layers.hidden = options.length === 0;
    this.viewpoints.hidden = !data?.viewpoints;
    this.note.textContent = data?.pictureNote ?? "";
    if (!data || data.frames.length === 0) void this.show(null);
    else if (other) this.error.clear();
  }

  /** Says why there is no picture. */
  setEmpty(text: string): void {
    this.empty.textContent = text;
  }

  /** Asks for a frame's picture; a coarse one is followed by a full one when things rest. */
  ask(frame: number, coarse = false): void {
    this.frame = frame;
    if (!this.data || this.data.frames.length === 0 || !this.visible()) return;
    this.work.call({ frame, size: coarse ? 224 : this.fullSize() });
    if (coarse) this.later(250);
  }

  /** The 3D view was turned: a picture from there is out of date. */
  turned(): void {
    if (this.viewpoint === "view") this.ask(this.frame, true);
  }

  /** True if pictures are seen as in the photograph. */
  get fromCamera(): boolean {
    return this.viewpoint === "given";
  }

  /** Shows pictures as seen in the photograph. */
  seeFromCamera(): void {
    this.viewpoints.value = "given";
    this.setViewpoint("given");
  }

  /** Shows the photograph alone, or again the layer that it replaced. */
  showPhotograph(wanted: boolean): void {
    if (wanted === (this.behind !== null)) return;
    const layer = wanted ? "photo" : this.behind!;
    this.behind = wanted ? this.layer : null;
    if (wanted) this.viewpoint = this.viewpoints.value = "given";
    // The layer may have been chosen otherwise meanwhile.
    if (wanted || this.layer === "photo") this.setLayer(layer);
  }

  /** Chooses the layer. */
  setLayer(layer: string): void {
    this.wanted = this.layer = layer;
    if (this.layers.value !== layer) this.layers.value = layer;
    this.onLayer(layer);
    this.looked();
    this.ask(this.frame);
  }

  private setViewpoint(viewpoint: string): void {
    this.viewpoint = viewpoint;
    // The photograph was taken from one place only.
    if (viewpoint !== "given" && ["overlay", "photo", "residuals"].includes(this.layer)) {
      this.setLayer("scene");
    } else {
      this.looked();
      this.ask(this.frame);
    }
  }

  private looked(): void {
    for (const listener of this.onLook) listener();
  }

  private later(wait: number): void {
    if (this.fullTimer) clearTimeout(this.fullTimer);
    this.fullTimer = setTimeout(() => this.ask(this.frame), wait);
  }

  private visible(): boolean {
    return this.element.offsetParent !== null && document.visibilityState === "visible";
  }

  private fullSize(): number {
    const { clientWidth, clientHeight } = this.element;
    const pixels = Math.max(clientWidth, clientHeight) * Math.min(devicePixelRatio, 2);
    return Math.min(1536, Math.max(256, Math.ceil(pixels / 64) * 64));
  }

  private async load({ frame, size }: Request): Promise<void> {
    const data = this.data;
    if (!data || frame >= data.frames.length) return;
    const camera = await this.cameraFor(data, frame);
    const picture = await data.picture(frame, this.layer, size, camera);
    if (data.key !== this.data?.key) {
      if (picture.owned) URL.revokeObjectURL(picture.url);
      return;
    }
    this.error.clear();
    await this.show(picture);
  }

  private async cameraFor(data: ViewerData, frame: number): Promise<Camera | undefined> {
    if (this.viewpoint === "given") return undefined;
    if (this.viewpoint === "view") return this.viewOf3D() ?? undefined;
    const [camera, mesh] = await Promise.all([data.camera(frame), data.mesh(frame)]);
    return camera ? turned(camera, this.viewpoint, middle(mesh.positions)) : undefined;
  }

  private async show(picture: ImageUrl | null): Promise<void> {
    const before = this.shown;
    this.shown = picture;
    this.image.hidden = picture === null;
    this.empty.hidden = picture !== null;
    if (picture) {
      this.image.src = picture.url;
      this.image.alt = LAYERS.find(([key]) => key === this.layer)?.[1] ?? this.layer;
      // Decoded before the next is asked for, so that the view never flashes.
      await this.image.decode().catch(() => {});
    }
    if (before?.owned) URL.revokeObjectURL(before.url);
  }

  private fail(error: unknown): void {
    // While the connection is lost the last picture stays: the banner says what is wrong.
    if (error instanceof Disconnected) return;
    void this.show(null);
    if (isWithoutScene(error)) {
      this.setEmpty("This program draws no scene: its draws are under Plots.");
      return;
    }
    this.empty.hidden = true;
    this.error.show(error);
  }
}

/** A camera that looks at the scene's middle from another side, as far away. */
function turned(camera: Camera, side: string, target: Vec3): Camera {
  const [x, y, z] = camera.eye.map((c, i) => c - target[i]!) as Vec3;
  const distance = Math.hypot(x, y, z);
  const eyes: Record<string, Vec3> = {
    left: [-z, y, x],
    right: [z, y, -x],
    behind: [-x, y, -z],
    // Exactly from above there would be no upward direction.
    above: [0.05 * x, distance, 0.05 * z],
  };
  const eye = (eyes[side] ?? [x, y, z]).map((c, i) => c + target[i]!) as Vec3;
  const fov = camera.fov_y ?? fovOfHeight(camera.height ?? 1, distance);
  return { eye, target, up: [0, 1, 0], fov_y: fov };
}

/** The middle of the box around points. */
function middle(positions: Float32Array): Vec3 {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3]!, x);
    high[i % 3] = Math.max(high[i % 3]!, x);
  });
  return low.map((l, k) => (positions.length > 0 ? (l + high[k]!) / 2 : 0)) as Vec3;
}

function fovOfHeight(height: number, distance: number): number {
  return (2 * Math.atan(height / 2 / Math.max(distance, 1e-6)) * 180) / Math.PI;
}
