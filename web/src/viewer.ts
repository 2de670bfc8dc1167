// The viewer: a frame's picture and its mesh side by side, and a slider over the frames. The
// studio, the report and the notebook all use it; only their data differ: in the studio they come
// from the program, in a report they lie in the page, in a notebook the kernel has them.

import { button, fill, h, number, Segments, select, setOptions } from "./dom";
import { PictureView } from "./picture_view";
import type { Camera, Mesh } from "./protocol";
import { SpaceView } from "./space_view";

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

const FRAMES_A_SECOND = 6;

/** Shows frames. */
export class Viewer {
  readonly element: HTMLElement;
  /** Called when the user moved the slider. */
  onFrame: (frame: number) => void = () => {};
  readonly pictures = new PictureView();

  private data: ViewerData | null = null;
  private frame = 0;
  private playing: ReturnType<typeof setTimeout> | null = null;
  private readonly space = new SpaceView();
  private readonly panes: HTMLElement;
  private readonly layout: Segments;
  private readonly slider = h("input", { type: "range", min: "0", step: "1", value: "0" });
  private readonly label = h("output", { class: "frame-label" });
  private readonly play = button("▶", () => this.togglePlay(), { "aria-label": "Play" });
  private readonly chains = select([], "all", () => this.setFrame(this.frame), {
    "aria-label": "Chain",
  });
  private readonly bar: HTMLElement;
  private readonly seen = () => this.refresh();
  private arranged = "";

  /** `before` is put in front of the viewer's own controls. */
  constructor(...before: HTMLElement[]) {
    const layouts: [string, string][] = [
      ["picture", "Picture"],
      ["space", "3D"],
      ["both", "Both"],
    ];
    this.layout = new Segments("What is shown", layouts, "both", () => this.arrange());
    this.slider.setAttribute("aria-label", "Frame");
    this.slider.addEventListener("input", () => {
      this.stop();
      this.setFrame(this.allowed()[Number(this.slider.value)] ?? 0, true);
    });
    this.bar = h(
      "div",
      { class: "frame-bar" },
      this.play,
      button("‹", () => this.step(-1), { "aria-label": "Previous", class: "quiet" }),
      this.slider,
      button("›", () => this.step(1), { "aria-label": "Next", class: "quiet" }),
      this.chains,
      this.label,
    );
    this.panes = h(
      "div",
      { class: "panes" },
      h("section", { class: "pane" }, this.pictures.tools, this.pictures.element),
      h("section", { class: "pane" }, this.space.tools, this.space.element),
    );
    this.element = h(
      "div",
      { class: "viewer" },
      h("div", { class: "viewer-head" }, ...before, this.layout.element),
      this.panes,
      this.bar,
    );
    this.pictures.viewOf3D = () => this.space.viewpoint();
    this.space.onTurn = () => this.pictures.turned();
    new ResizeObserver(() => this.arrange()).observe(this.panes);
    document.addEventListener("visibilitychange", this.seen);
    this.setData(null);
  }

  /** False if the browser offers no WebGL. */
  get has3D(): boolean {
    return this.space.works;
  }

  /** Ends the viewer; the browser has few contexts for drawing in 3D. */
  dispose(): void {
    this.stop();
    document.removeEventListener("visibilitychange", this.seen);
    this.space.dispose();
  }

  /** Shows data, from the given frame. */
  setData(data: ViewerData | null, frame = 0): void {
    if (data?.key !== this.data?.key) this.stop();
    this.data = data;
    this.pictures.setData(data);
    this.space.setData(data);
    const chains = [...new Set((data?.frames ?? []).map((f) => f.chain))]
      .filter((c): c is number => c !== null)
      .sort((a, b) => a - b);
    const options = chains.map((c) => [String(c), `Chain ${c}`] as [string, string]);
    setOptions(this.chains, [["all", "All chains"], ...options], this.chains.value || "all");
    if (this.chains.selectedIndex < 0) this.chains.value = "all";
    this.chains.hidden = chains.length < 2;
    this.bar.hidden = (data?.frames.length ?? 0) < 2;
    const hasPictures = data === null || data.layers.length > 0;
    this.layout.element.hidden = !hasPictures;
    if (!hasPictures) this.layout.value = "space";
    this.arrange();
    this.setFrame(frame);
  }

  /** The frames were replaced by longer lists of the same states, or by other states
   * in the same places: shows them again, coarsely at first while a choice is dragged. */
  refresh(coarse = false): void {
    if (!this.data) return;
    this.pictures.ask(this.frame, coarse);
    this.space.ask(this.frame);
  }

  /** Says why there is no picture. */
  setEmpty(text: string): void {
    this.pictures.setEmpty(text);
  }

  /** The frame shown. */
  get current(): number {
    return this.frame;
  }

  /** Shows a frame. */
  setFrame(frame: number, byUser = false): void {
    const allowed = this.allowed();
    let place = allowed.indexOf(frame);
    if (place < 0) place = Math.max(0, allowed.findIndex((f) => f > frame));
    this.frame = allowed[place] ?? 0;
    this.slider.max = String(Math.max(0, allowed.length - 1));
    this.slider.value = String(place);
    this.describe(place, allowed.length);
    this.refresh(this.playing !== null);
    if (byUser) this.onFrame(this.frame);
  }

  private describe(place: number, total: number): void {
    const frame = this.data?.frames[this.frame];
    fill(this.label, frame ? `${frame.label}` : "");
    if (!frame) return;
    this.slider.setAttribute("aria-valuetext", `${frame.label}, ${place + 1} of ${total}`);
    const joint = frame.logJoint === null ? "" : `log joint ${number(frame.logJoint)}`;
    this.label.append(h("span", { class: "muted" }, `${place + 1} / ${total}  ${joint}`));
  }

  /** The frames of the chosen chain. */
  private allowed(): number[] {
    const frames = this.data?.frames ?? [];
    const chain = this.chains.value;
    const all = frames.map((_, i) => i);
    if (chain === "all" || chain === "") return all;
    return all.filter((i) => String(frames[i]!.chain) === chain);
  }

  private step(by: number): void {
    this.stop();
    const allowed = this.allowed();
    const place = allowed.indexOf(this.frame) + by;
    const frame = allowed[Math.min(allowed.length - 1, Math.max(0, place))];
    if (frame !== undefined) this.setFrame(frame, true);
  }

  private togglePlay(): void {
    if (this.playing) {
      this.stop();
      return;
    }
    const allowed = this.allowed();
    if (this.frame === allowed[allowed.length - 1]) this.setFrame(allowed[0] ?? 0, true);
    this.play.textContent = "❚❚";
    this.play.setAttribute("aria-label", "Pause the film");
    const next = () => {
      const frames = this.allowed();
      const place = frames.indexOf(this.frame) + 1;
      if (place >= frames.length) {
        this.stop();
        this.refresh();
        return;
      }
      this.playing = setTimeout(next, 1000 / FRAMES_A_SECOND);
      this.setFrame(frames[place]!, true);
    };
    this.playing = setTimeout(next, 0);
  }

  private stop(): void {
    if (this.playing) clearTimeout(this.playing);
    this.playing = null;
    this.play.textContent = "▶";
    this.play.setAttribute("aria-label", "Play");
  }

  private arrange(): void {
    const [picture, space] = this.panes.children as unknown as [HTMLElement, HTMLElement];
    const layout = this.layout.value;
    picture.hidden = layout === "space";
    space.hidden = layout === "picture";
    const { clientWidth, clientHeight } = this.panes;
    this.panes.classList.toggle("side-by-side", clientWidth > 1.1 * clientHeight);
    // A hidden view asks for nothing, nor does a viewer that is not yet in its page.
    const arranged = `${layout} ${clientWidth > 0}`;
    if (arranged === this.arranged) return;
    this.arranged = arranged;
    this.refresh();
  }
}
