// The viewer: a frame's picture and its mesh side by side, and a timeline of the frames. The
// studio, the report and the notebook all use it; only their data differ: in the studio they come
// from the program, in a report they lie in the page, in a notebook the kernel has them.

import { button, fill, h, number, Segments, select, setOptions } from "./dom";
import { PictureView } from "./picture_view";
import type { Camera, Mesh } from "./protocol";
import { SpaceView } from "./space_view";
import { Timeline } from "./timeline";

/** One place of the viewer's timeline. */
export interface Frame {
  label: string;
  chain: number | null;
  /** Its place along the chain; null: frames are evenly spaced. */
  step: number | null;
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
  /** Called when the user moved along the timeline. */
  onFrame: (frame: number) => void = () => {};
  readonly pictures = new PictureView();

  private data: ViewerData | null = null;
  private frame = 0;
  private playing: ReturnType<typeof setTimeout> | null = null;
  private readonly space = new SpaceView();
  private readonly panes: HTMLElement;
  private readonly layout: Segments;
  private readonly timeline = new Timeline();
  /** The frames of other data, to which the timeline leads while these have only one. */
  private others: Frame[] = [];
  private readonly label = h("output", { class: "frame-label" });
  private readonly play = button("▶", () => this.togglePlay(), {
    "aria-label": "Play",
    class: "play",
  });
  private readonly chains = select([], "all", () => this.showChain(), { "aria-label": "Chain" });
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
    this.timeline.onScrub = (frame) => {
      this.stop();
      this.go(frame);
    };
    this.bar = h(
      "div",
      { class: "frame-bar" },
      this.timeline.element,
      h(
        "div",
        { class: "frame-controls" },
        this.play,
        button("‹", () => this.step(-1), { "aria-label": "Previous", class: "quiet" }),
        button("›", () => this.step(1), { "aria-label": "Next", class: "quiet" }),
        this.chains,
        this.label,
      ),
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
    this.element.addEventListener("keydown", (event) => this.key(event));
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
    this.showTimeline();
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
  setFrame(frame: number): void {
    const allowed = this.isElsewhere ? [0] : this.allowed();
    let place = allowed.indexOf(frame);
    if (place < 0) place = Math.max(0, allowed.findIndex((f) => f > frame));
    this.frame = allowed[place] ?? 0;
    this.describe(place, allowed.length);
    this.refresh(this.playing !== null);
  }

  /** Sets the frames of other data, to which the timeline leads while these have only one. */
  setOthers(others: Frame[]): void {
    this.others = others;
    this.showTimeline();
  }

  /** Moves by some frames of the chosen chain. */
  step(by: number): void {
    if (this.bar.hidden) return;
    this.stop();
    const allowed = this.allowed();
    // All other frames lead to what is shown at present.
    const place = this.isElsewhere ? allowed.length : allowed.indexOf(this.frame);
    const frame = allowed[Math.min(allowed.length - 1, Math.max(0, place + by))];
    if (frame !== undefined) this.go(frame);
  }

  /** The user wants a frame. */
  private go(frame: number): void {
    if (!this.isElsewhere) this.setFrame(frame);
    this.onFrame(this.isElsewhere ? frame : this.frame);
  }

  private get isElsewhere(): boolean {
    return (this.data?.frames.length ?? 0) < 2;
  }

  private get listed(): Frame[] {
    return this.isElsewhere ? this.others : (this.data?.frames ?? []);
  }

  private showTimeline(): void {
    this.bar.hidden = this.listed.length < 2;
    this.play.hidden = this.isElsewhere;
    if (this.isElsewhere) this.chains.hidden = true;
    this.timeline.show(this.listed, this.allowed());
    this.describe(this.allowed().indexOf(this.frame), this.allowed().length);
  }

  private showChain(): void {
    this.timeline.show(this.listed, this.allowed());
    this.setFrame(this.frame);
  }

  private describe(place: number, total: number): void {
    if (this.isElsewhere) {
      const text = `${this.listed.length} kept states`;
      this.timeline.place(null, text);
      fill(this.label, text, h("span", { class: "muted" }, "drag along the timeline, or press ←"));
      return;
    }
    const frame = this.data?.frames[this.frame];
    fill(this.label, frame ? `${frame.label}` : "");
    if (!frame) return;
    this.timeline.place(this.frame, `${frame.label}, ${place + 1} of ${total}`);
    const joint = frame.logJoint === null ? "" : `log joint ${number(frame.logJoint)}`;
    this.label.append(h("span", { class: "muted" }, `${place + 1} / ${total}  ${joint}`));
  }

  /** The frames of the chosen chain. */
  private allowed(): number[] {
    const frames = this.listed;
    const chain = this.chains.value;
    const all = frames.map((_, i) => i);
    if (this.isElsewhere || chain === "all" || chain === "") return all;
    return all.filter((i) => String(frames[i]!.chain) === chain);
  }

  private togglePlay(): void {
    if (this.playing) {
      this.stop();
      return;
    }
    const allowed = this.allowed();
    if (this.frame === allowed[allowed.length - 1]) this.go(allowed[0] ?? 0);
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
      this.go(frames[place]!);
    };
    this.playing = setTimeout(next, 0);
  }

  /** The arrow keys move by one frame, unless what has the focus uses them itself. */
  key(event: KeyboardEvent): void {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const own = "input, select, textarea, canvas, svg, [role=application], [contenteditable]";
    const isUsed = event.defaultPrevented || (event.target as Element).closest(own) !== null;
    if (!by || isUsed || event.altKey || event.ctrlKey || event.metaKey || this.bar.hidden) return;
    event.preventDefault();
    this.step(by);
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
