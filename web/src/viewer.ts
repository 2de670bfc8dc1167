// The viewer: a frame's picture and its mesh side by side, and a slider over the frames. The
// studio and the report both use it; only their sources differ.

import { button, fill, h, number, Segments, select, setOptions } from "./dom";
import { PictureView } from "./picture_view";
import type { Source } from "./source";
import { SpaceView } from "./space_view";

const FRAMES_A_SECOND = 6;

/** Shows the frames of a source. */
export class Viewer {
  readonly element: HTMLElement;
  /** Called when the user moved the slider. */
  onFrame: (frame: number) => void = () => {};

  private source: Source | null = null;
  private frame = 0;
  private playing: ReturnType<typeof setTimeout> | null = null;
  private readonly pictures = new PictureView();
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
    document.addEventListener("visibilitychange", () => this.refresh());
    this.setSource(null);
  }

  /** Shows a source, from the given frame. */
  setSource(source: Source | null, frame = 0): void {
    if (source?.key !== this.source?.key) this.stop();
    this.source = source;
    this.pictures.setSource(source);
    this.space.setSource(source);
    const chains = [...new Set((source?.frames ?? []).map((f) => f.chain))]
      .filter((c): c is number => c !== null)
      .sort((a, b) => a - b);
    const options = chains.map((c) => [String(c), `Chain ${c}`] as [string, string]);
    setOptions(this.chains, [["all", "All chains"], ...options], this.chains.value || "all");
    if (this.chains.selectedIndex < 0) this.chains.value = "all";
    this.chains.hidden = chains.length < 2;
    this.bar.hidden = (source?.frames.length ?? 0) < 2;
    const hasPictures = source === null || source.layers.length > 0;
    this.layout.enable("picture", hasPictures);
    this.layout.enable("both", hasPictures);
    if (!hasPictures) this.layout.value = "space";
    this.arrange();
    this.setFrame(frame);
  }

  /** The source's frames were replaced by longer lists of the same states, or by other states
   * in the same places: shows them again, coarsely at first while a choice is dragged. */
  refresh(coarse = false): void {
    if (!this.source) return;
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
    const frame = this.source?.frames[this.frame];
    fill(this.label, frame ? `${frame.label}` : "");
    if (!frame) return;
    this.slider.setAttribute("aria-valuetext", `${frame.label}, ${place + 1} of ${total}`);
    const joint = frame.logJoint === null ? "" : `log joint ${number(frame.logJoint)}`;
    this.label.append(h("span", { class: "muted" }, `${place + 1} / ${total}  ${joint}`));
  }

  /** The frames of the chosen chain. */
  private allowed(): number[] {
    const frames = this.source?.frames ?? [];
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
    const before = `${picture.hidden} ${space.hidden}`;
    picture.hidden = layout === "space";
    space.hidden = layout === "picture";
    const changed = before !== `${picture.hidden} ${space.hidden}`;
    const { clientWidth, clientHeight } = this.panes;
    this.panes.classList.toggle("side-by-side", clientWidth > 1.1 * clientHeight);
    if (changed) this.refresh();
  }
}
