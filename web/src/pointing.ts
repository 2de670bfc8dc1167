// What a user points out in a photograph, and how presses and drags change it. All positions are
// pixels of the photograph.

import type { Hint, Point } from "./protocol";

export type Tool = "point" | "box" | "axis" | "outline";

/** Nothing was pointed out. */
export const NO_HINT: Hint = { mask: null, outline: [], box: null, axis: null, at: [], not: [] };

/** The shortest side of a box, and the shortest axis: less is a slip of the hand. */
const LEAST = 3;
/** The width of a new axis, as a part of its length. */
const WIDE = 0.5;

/** True if nothing was pointed out. */
export function isEmpty(hint: Hint): boolean {
  const { mask, outline, box, axis, at, not } = hint;
  return !mask && !box && !axis && outline.length + at.length + not.length === 0;
}

/** A text that equal hints have in common. */
export function hintKey({ mask, outline, box, axis, at, not }: Hint): string {
  return JSON.stringify([mask, outline, box, axis && [axis.foot, axis.top, axis.width], at, not]);
}

/** A hint that is being changed with one of the tools. Each press ends with a release. */
export class Pointing {
  hint: Hint = NO_HINT;
  tool: Tool | null = null;
  /** Corners of an outline that is not closed yet. */
  open: Point[] = [];
  /** Moves what was taken hold of. */
  private grip: ((to: Point) => void) | null = null;
  private before: Hint = NO_HINT;

  /** True while something is dragged. */
  get dragging(): boolean {
    return this.grip !== null;
  }

  /** Presses at a position; what is at most `near` away is meant. `other` is the second meaning of
   * a press: beside the object, or away with a corner. */
  press(at: Point, near: number, other = false): void {
    this.before = this.hint;
    const close = (p: Point) => distance(p, at) <= near;
    if (this.tool === "point") this.mark(at, close, other);
    else if (this.tool === "box") this.pressBox(at, close);
    else if (this.tool === "axis") this.pressAxis(at, close);
    else if (this.tool === "outline") this.pressOutline(at, close, other);
  }

  /** Drags what was taken hold of. */
  drag(to: Point): void {
    this.grip?.(to);
  }

  /** Ends a press; true if it changed the hint. */
  release(): boolean {
    this.grip = null;
    const { box, axis } = this.hint;
    const slip = box !== this.before.box && box && Math.min(box[2], box[3]) < LEAST;
    const short = axis !== this.before.axis && axis && distance(axis.foot, axis.top) < LEAST;
    if (slip || short) this.hint = this.before;
    const changed = this.hint !== this.before;
    this.before = this.hint;
    return changed;
  }

  /** Closes the outline; true if it has enough corners. */
  close(): boolean {
    if (this.open.length < 3) return false;
    this.hint = { ...this.hint, outline: this.open };
    this.open = [];
    return true;
  }

  /** Gives up what is being drawn; true if there was anything. */
  cancel(): boolean {
    const was = this.dragging || this.open.length > 0;
    if (this.dragging) this.hint = this.before;
    this.grip = null;
    this.open = [];
    return was;
  }

  /** Removes what the tool has drawn; true if there was anything. */
  remove(): boolean {
    const { hint } = this;
    const without: Record<Tool, Partial<Hint>> = {
      point: { at: [], not: [] },
      box: { box: null },
      axis: { axis: null },
      outline: { outline: [] },
    };
    if (this.tool) this.hint = { ...hint, ...without[this.tool] };
    this.open = [];
    return hintKey(hint) !== hintKey(this.hint);
  }

  /** A mark on the object becomes one beside it, and that disappears. */
  private mark(at: Point, close: (p: Point) => boolean, beside: boolean): void {
    const { hint } = this;
    const on = hint.at.findIndex(close);
    const off = hint.not.findIndex(close);
    if (on >= 0) {
      this.hint = { ...hint, at: without(hint.at, on), not: [...hint.not, hint.at[on]!] };
    } else if (off >= 0) this.hint = { ...hint, not: without(hint.not, off) };
    else if (beside) this.hint = { ...hint, not: [...hint.not, at] };
    else this.hint = { ...hint, at: [...hint.at, at] };
  }

  private pressBox(at: Point, close: (p: Point) => boolean): void {
    const corners = boxCorners(this.hint);
    const held = corners.findIndex(close);
    const fixed = held >= 0 ? corners[(held + 2) % 4]! : at;
    this.grip = ([x, y]) => {
      const [left, top] = [Math.min(x, fixed[0]), Math.min(y, fixed[1])];
      const size: Point = [tenth(Math.abs(x - fixed[0])), tenth(Math.abs(y - fixed[1]))];
      this.hint = { ...this.hint, box: [left, top, ...size] };
    };
  }

  private pressAxis(at: Point, close: (p: Point) => boolean): void {
    const { axis } = this.hint;
    const set = (next: NonNullable<Hint["axis"]>) => {
      this.hint = { ...this.hint, axis: next };
    };
    if (axis && close(axis.foot)) this.grip = (foot) => set({ ...axis, foot });
    else if (axis && close(axis.top)) this.grip = (top) => set({ ...axis, top });
    else if (axis && axisSides(axis).some(close)) {
      this.grip = (to) => {
        set({ ...axis, width: Math.max(1, tenth(2 * Math.abs(across(axis, to)))) });
      };
    } else {
      this.grip = (top) => {
        set({ foot: at, top, width: Math.max(1, tenth(WIDE * distance(at, top))) });
      };
    }
  }

  private pressOutline(at: Point, close: (p: Point) => boolean, remove: boolean): void {
    const isOpen = this.open.length > 0;
    const corners = isOpen ? this.open : this.hint.outline;
    const set = (next: Point[]) => {
      if (isOpen) this.open = next;
      else this.hint = { ...this.hint, outline: next.length < 3 ? [] : next };
    };
    const held = corners.findIndex(close);
    if (held < 0) {
      // A closed outline stays until the next one is closed.
      this.open = [...this.open, at];
      return;
    }
    const isEnd = held === 0 || held === corners.length - 1;
    if (remove) set(without(corners, held));
    // The second press of a double click is on the corner that the first has made.
    else if (isOpen && isEnd) this.close();
    else this.grip = (to) => set(corners.map((c, i) => (i === held ? to : c)));
  }
}

function without<T>(all: T[], index: number): T[] {
  return all.filter((_, i) => i !== index);
}

function distance(a: Point, b: Point): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

/** Rounds to tenths: a hint is also written on a command line. */
export function tenth(x: number): number {
  return Math.round(10 * x) / 10;
}

/** The corners of the box, in turn. */
export function boxCorners({ box }: Hint): Point[] {
  if (!box) return [];
  const [x, y, w, h] = box;
  return [[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
}

type Axis = NonNullable<Hint["axis"]>;

/** The unit vector across an axis. */
function normal({ foot, top }: Axis): Point {
  const length = Math.max(distance(foot, top), 1e-9);
  return [(foot[1] - top[1]) / length, (top[0] - foot[0]) / length];
}

function across(axis: Axis, to: Point): number {
  const [nx, ny] = normal(axis);
  return (to[0] - axis.foot[0]) * nx + (to[1] - axis.foot[1]) * ny;
}

/** The middles of both sides, by which the width is changed. */
export function axisSides(axis: Axis): Point[] {
  const [nx, ny] = normal(axis);
  const middle = [0, 1].map((c) => (axis.foot[c]! + axis.top[c]!) / 2) as Point;
  return [1, -1].map((side) => {
    const by = (side * axis.width) / 2;
    return [middle[0] + by * nx, middle[1] + by * ny];
  });
}

/** The corners of the strip that an axis with its width covers. */
export function axisCorners(axis: Axis): Point[] {
  const [nx, ny] = normal(axis);
  const at = ([x, y]: Point, side: number): Point => {
    return [x + (side * axis.width * nx) / 2, y + (side * axis.width * ny) / 2];
  };
  return [at(axis.foot, 1), at(axis.top, 1), at(axis.top, -1), at(axis.foot, -1)];
}
