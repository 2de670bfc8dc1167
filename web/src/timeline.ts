// The timeline of kept states: a row for each chain, on which its states lie along the steps and
// their log joint densities are a curve. The pointer or the arrow keys scrub through them.

import { chainColour } from "./colour_map";
import { h } from "./dom";
import { range } from "./plot_data";
import { svg } from "./svg";
import type { Frame } from "./viewer";

/** The size of the drawing, which is stretched to the element's. */
const WIDTH = 1000;
const ROW = 20;
/** Log densities below this part of the states are drawn at the bottom: the first ones of a film
 * are far below the others. */
const LOW = 0.1;

/** Where a state is drawn: across in parts of the width, and in which row. */
interface Mark {
  frame: number;
  across: number;
  row: number;
}

/** Shows states and which of them is looked at. */
export class Timeline {
  readonly element: HTMLElement;
  /** Called with the frame that the user scrubs to. */
  onScrub: (frame: number) => void = () => {};

  /** Works the keys, and tells assistive technology where it is. */
  private readonly slider = h("input", { type: "range", min: "0", step: "1", value: "0" });
  private readonly drawing = svg("svg", { preserveAspectRatio: "none", "aria-hidden": "true" });
  private readonly head = h("i", { class: "playhead" });
  private readonly dot = h("i", { class: "dot" });
  private marks: Mark[] = [];
  private rows = 1;

  constructor() {
    this.slider.setAttribute("aria-label", "Frame");
    this.slider.addEventListener("input", () => {
      const mark = this.marks[Number(this.slider.value)];
      if (mark) this.onScrub(mark.frame);
    });
    this.element = h("div", { class: "timeline" }, this.head, this.dot, this.slider);
    this.element.prepend(this.drawing);
    this.listen();
  }

  /** Shows the given ones of all frames. */
  show(all: Frame[], shown: number[]): void {
    const chains = [...new Set(shown.map((i) => all[i]!.chain))];
    this.rows = Math.max(1, chains.length);
    const steps = shown.map((i, place) => all[i]!.step ?? place);
    // Steps that grow geometrically would crowd on the left.
    const middle = [...steps].sort((a, b) => a - b)[Math.floor(steps.length / 2)] ?? 0;
    const scale = middle < Math.max(0, ...steps) / 5 ? Math.log1p : (x: number) => x;
    const [first, last] = range(steps.map(scale));
    const across = (step: number) => (scale(step) - first) / (last - first);
    this.marks = shown.map((frame, i) => {
      return { frame, across: across(steps[i]!), row: chains.indexOf(all[frame]!.chain) };
    });
    this.slider.max = String(Math.max(0, shown.length - 1));
    this.element.style.setProperty("--rows", String(this.rows));
    this.drawing.setAttribute("viewBox", `0 0 ${WIDTH} ${ROW * this.rows}`);
    this.draw(all);
  }

  /** Marks a frame as the one that is looked at; null: none of these. */
  place(frame: number | null, text: string): void {
    const at = this.marks.findIndex((mark) => mark.frame === frame);
    const mark = this.marks[at];
    this.head.hidden = this.dot.hidden = mark === undefined;
    this.slider.value = String(mark ? at : this.marks.length - 1);
    this.slider.setAttribute("aria-valuetext", text);
    if (!mark) return;
    this.head.style.left = this.dot.style.left = `${100 * mark.across}%`;
    this.dot.style.top = `${(100 * (mark.row + 0.5)) / this.rows}%`;
  }

  private draw(all: Frame[]): void {
    const joints = this.marks.map(({ frame }) => all[frame]!.logJoint);
    const known = joints.filter((x): x is number => x !== null).sort((a, b) => a - b);
    const [low, high] = range(known.slice(Math.floor(LOW * known.length)));
    const height = (x: number) => (Math.min(1, Math.max(0, (x - low) / (high - low))) - 0.5) * 0.7;
    const parts: SVGElement[] = [];
    for (let row = 0; row < this.rows; row++) {
      const own = this.marks.map((mark, i) => ({ ...mark, joint: joints[i]! }));
      const states = own.filter((mark) => mark.row === row);
      const base = (row + 0.5) * ROW;
      const ticks = states.map((m) => `M${round(m.across * WIDTH)} ${base - 0.42 * ROW}v${0.84 * ROW}`);
      const curve = states.filter((m) => m.joint !== null);
      const points = curve.map((m) => `${round(m.across * WIDTH)} ${round(base - height(m.joint) * ROW)}`);
      parts.push(svg("path", { d: ticks.join(""), class: "ticks" }));
      if (points.length < 2) continue;
      const line = svg("path", { d: `M${points.join("L")}`, class: "curve" });
      const chain = all[states[0]!.frame]!.chain;
      line.style.stroke = chain === null ? "" : chainColour(chain - 1);
      parts.push(line);
    }
    this.drawing.replaceChildren(...parts);
  }

  private listen(): void {
    const { element } = this;
    let row: number | null = null;
    const scrub = (event: PointerEvent) => {
      const box = this.drawing.getBoundingClientRect();
      const across = (event.clientX - box.left) / box.width;
      row ??= Math.min(this.rows - 1, Math.max(0, Math.floor(((event.clientY - box.top) / box.height) * this.rows)));
      const own = this.marks.filter((mark) => mark.row === row);
      const away = (mark: Mark) => Math.abs(mark.across - across);
      const nearest = own.reduce((a, b) => (away(b) < away(a) ? b : a), own[0]!);
      if (nearest) this.onScrub(nearest.frame);
    };
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      this.slider.focus({ preventScroll: true });
      row = null;
      scrub(event);
    });
    element.addEventListener("pointermove", (event) => {
      if (element.hasPointerCapture(event.pointerId)) scrub(event);
    });
  }
}

function round(x: number): number {
  return Math.round(10 * x) / 10;
}
