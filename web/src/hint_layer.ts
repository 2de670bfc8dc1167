// Pointing out the object in the photograph: the tools, what was drawn with them, and the outline
// that the program guesses from it.

import type { Actions } from "./actions";
import { Latest } from "./connection";
import { button, h } from "./dom";
import { ErrorBox } from "./errors";
import type { PictureView } from "./picture_view";
import {
  axisCorners,
  axisSides,
  boxCorners,
  hintKey,
  isEmpty,
  NO_HINT,
  Pointing,
  tenth,
  type Tool,
} from "./pointing";
import type { Guess, Hint, Point } from "./protocol";
import { svg } from "./svg";

const TOOLS: [Tool, string, string][] = [
  [
    "point",
    "Point",
    "Click on the object, or on the person who is meant; Alt- or Shift-click beside it. " +
      "A click on a mark turns it over, and a second one removes it",
  ],
  ["box", "Box", "Drag a box around the object; drag a corner to change it"],
  [
    "axis",
    "Axis",
    "Drag from the foot of the object to its top; then drag a side to its width, or an end",
  ],
  [
    "outline",
    "Outline",
    "Click corners around the object; a double click or Enter closes, Escape gives up. " +
      "Drag a corner to move it, Alt-click removes it",
  ],
];

/** What the drawing over the photograph shows while no tool is chosen. */
const POINTED_OUT = "What was pointed out";
/** How near a press is to what it means, in CSS pixels. */
const NEAR = { mouse: 9, touch: 22 };
/** How far an arrow key moves the cross, as a part of the photograph's longer side. */
const STEP = 0.01;

interface Request {
  hint: Hint;
  /** It is still being drawn: only a quick answer matters. */
  quick: boolean;
}

/** Draws and changes the hint of the session's photograph. */
export class HintLayer {
  readonly bar: HTMLElement;
  readonly element: SVGSVGElement;
  /** Called when a tool is chosen. */
  onTool: () => void = () => {};
  private readonly pointing = new Pointing();
  private readonly tools = new Map<Tool, HTMLButtonElement>();
  private readonly clear = button("Clear", () => this.clearAll(), {
    title: "Point out nothing",
  });
  private readonly said = h("output", { class: "muted", "aria-live": "polite" });
  private readonly error = new ErrorBox();
  private guess: Guess | null = null;
  private rough = false;
  private looking = false;
  /** The photograph to which the hint belongs. */
  private photo = "";
  private size: Point = [1, 1];
  /** The hint that the session has, or that it was sent. */
  private known = "";
  /** Where keys move the cross; null: the pointer is used. */
  private cross: Point | null = null;
  private readonly guesses = new Latest<Request>((r) => this.ask(r), (e) => this.error.show(e));

  constructor(
    private readonly actions: Actions,
    private readonly pictures: PictureView,
  ) {
    const buttons = TOOLS.map(([tool, name, about]) => {
      const element = button(name, () => this.choose(this.pointing.tool === tool ? null : tool), {
        title: about,
        "aria-pressed": "false",
      });
      this.tools.set(tool, element);
      return element;
    });
    const group = h("div", { class: "segments", role: "group", "aria-label": "Point out" });
    group.append(...buttons);
    this.bar = h("div", { class: "tools hint-bar" }, group, this.clear, this.said);
    this.element = svg("svg", {
      class: "hint-layer",
      role: "img",
      "aria-label": POINTED_OUT,
      preserveAspectRatio: "xMidYMid meet",
    });
    this.listen();
    pictures.element.before(this.bar);
    pictures.element.append(this.element, this.error.element);
    pictures.onLook.push(() => this.draw());
    new ResizeObserver(() => this.draw()).observe(pictures.element);
    actions.store.on(["session", "view"], () => this.follow());
    this.follow();
  }

  /** The session, its photograph or its hint changed, here or elsewhere. */
  private follow(): void {
    const { session, view } = this.actions.store.now;
    const photo = session?.has_view ? session.photo : null;
    this.bar.hidden = !photo;
    if (view !== "session" || !photo) this.choose(null);
    if (session && photo) {
      this.size = [photo.width, photo.height];
      this.element.setAttribute("viewBox", `0 0 ${photo.width} ${photo.height}`);
      const key = JSON.stringify([session.session, session.observe]);
      const another = key !== this.photo;
      const busy = this.pointing.dragging || this.actions.isHinting;
      if (another || (!busy && hintKey(session.hint) !== this.known)) this.adopt(session.hint);
      this.photo = key;
    }
    this.draw();
  }

  /** Shows the session's hint. With an empty one the program finds the objects of the photograph,
   * so that the first click is answered at once. */
  private adopt(hint: Hint): void {
    this.pointing.cancel();
    this.pointing.hint = hint;
    this.known = hintKey(hint);
    this.look(false);
  }

  private choose(tool: Tool | null): void {
    const { pointing } = this;
    if (tool === pointing.tool) return;
    pointing.cancel();
    // What a tool draws is about the session's photograph, seen without a scene over it.
    if (tool) this.onTool();
    if (tool) this.actions.store.set({ view: "session", at: null });
    this.pictures.showPhotograph(tool !== null);
    pointing.tool = tool;
    this.cross = null;
    for (const [t, element] of this.tools) element.setAttribute("aria-pressed", String(t === tool));
    const about = TOOLS.find(([t]) => t === tool)?.[2] ?? "";
    const keys = "Arrow keys move a cross, the space bar presses there.";
    this.element.setAttribute("role", tool ? "application" : "img");
    this.element.setAttribute("aria-label", tool ? `Photograph. ${about}. ${keys}` : POINTED_OUT);
    if (tool) this.element.setAttribute("tabindex", "0");
    else this.element.removeAttribute("tabindex");
    this.draw();
  }

  /** No tool is chosen any more. */
  putDown(): void {
    this.choose(null);
  }

  private clearAll(): void {
    this.pointing.cancel();
    this.pointing.hint = NO_HINT;
    this.commit();
  }

  /** The hint was changed: from now on it is the session's. */
  private commit(): void {
    const { hint } = this.pointing;
    this.known = hintKey(hint);
    this.error.clear();
    this.look(false);
    this.actions.hint(hint, (error) => {
      // The session keeps the hint that it has.
      const { session } = this.actions.store.now;
      if (session) this.adopt(session.hint);
      this.error.show(error);
    });
  }

  /** Asks what is where the hint is, quickly while it is still being drawn. */
  private look(quick: boolean): void {
    const { hint } = this.pointing;
    this.looking = true;
    if (isEmpty(hint)) this.guess = null;
    this.guesses.call({ hint, quick });
    this.draw();
  }

  private async ask({ hint, quick }: Request): Promise<void> {
    const session = this.actions.store.now.session?.session;
    if (session === undefined) return;
    for (const rough of quick ? [true] : [true, false]) {
      const params = { session, hint, quick: rough };
      const { place } = await this.actions.connection.ask<{ place: Guess | null }>("guess", params);
      const now = this.actions.store.now.session?.session;
      if (now !== session || this.pointing.hint !== hint) return;
      this.guess = place;
      this.rough = rough;
      this.looking = rough && !quick;
      this.draw();
      if (isEmpty(hint)) return;
    }
  }

  private listen(): void {
    const { element, pointing } = this;
    let held: number | null = null;
    element.addEventListener("pointerdown", (event) => {
      if (held !== null || event.button !== 0 || !pointing.tool) return;
      event.preventDefault();
      element.focus({ preventScroll: true });
      held = event.pointerId;
      element.setPointerCapture(held);
      this.cross = null;
      const near = event.pointerType === "mouse" ? NEAR.mouse : NEAR.touch;
      this.press(this.position(event), near, event);
    });
    element.addEventListener("pointermove", (event) => {
      if (event.pointerId !== held || !pointing.dragging) return;
      pointing.drag(this.position(event));
      this.look(true);
    });
    element.addEventListener("pointerup", (event) => {
      if (event.pointerId !== held) return;
      held = null;
      this.release();
    });
    element.addEventListener("pointercancel", (event) => {
      if (event.pointerId !== held) return;
      held = null;
      pointing.cancel();
      this.look(false);
    });
    element.addEventListener("keydown", (event) => this.key(event));
    element.addEventListener("blur", () => {
      this.cross = null;
      this.draw();
    });
  }

  private press(at: Point, near: number, keys: { altKey: boolean; shiftKey: boolean }): void {
    this.pointing.press(at, near * this.pixel(), keys.altKey || keys.shiftKey);
    this.draw();
  }

  private release(): void {
    if (this.pointing.release()) this.commit();
    else this.draw();
  }

  private key(event: KeyboardEvent): void {
    const { pointing } = this;
    const arrows: Record<string, Point> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const arrow = arrows[event.key];
    if (arrow) {
      const step = STEP * Math.max(...this.size) * (event.shiftKey ? 5 : 1);
      const from = this.cross ?? (this.size.map((s) => s / 2) as Point);
      this.cross = this.clamped([from[0] + step * arrow[0], from[1] + step * arrow[1]]);
      if (pointing.dragging) {
        pointing.drag(this.cross);
        this.look(true);
      }
    } else if (event.key === "Enter" && pointing.open.length >= 3) {
      pointing.close();
      this.commit();
    } else if (event.key === " " || event.key === "Enter") {
      if (!this.cross) return;
      if (pointing.dragging) this.release();
      else {
        this.press(this.cross, NEAR.mouse, event);
        // A box and an axis go on to the next press.
        if (!pointing.dragging) this.release();
      }
    } else if (event.key === "Escape") {
      if (pointing.cancel()) this.look(false);
      else {
        const chosen = this.tools.get(pointing.tool!);
        this.choose(null);
        chosen?.focus();
      }
    } else if (event.key === "Delete" || event.key === "Backspace") {
      if (pointing.remove()) this.commit();
    } else return;
    event.preventDefault();
    event.stopPropagation();
    this.draw();
  }

  /** Where an event is in the photograph. */
  private position(event: PointerEvent): Point {
    const matrix = this.element.getScreenCTM();
    if (!matrix) return [0, 0];
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    return this.clamped([at.x, at.y]);
  }

  private clamped(at: Point): Point {
    return at.map((x, c) => tenth(Math.min(this.size[c]!, Math.max(0, x)))) as Point;
  }

  /** The size of a CSS pixel, in pixels of the photograph. */
  private pixel(): number {
    const { clientWidth, clientHeight } = this.pictures.element;
    const scale = Math.min(clientWidth / this.size[0], clientHeight / this.size[1]);
    return scale > 0 ? 1 / scale : 1;
  }

  private draw(): void {
    const { pointing, guess, element } = this;
    const { hint, open, tool } = pointing;
    const { session, view } = this.actions.store.now;
    const shown = view === "session" && this.pictures.fromCamera && !this.bar.hidden;
    element.style.display = shown ? "" : "none";
    element.classList.toggle("active", tool !== null);
    this.clear.disabled = isEmpty(hint) && open.length === 0;
    this.describe();
    if (!session || !shown) return;
    const parts: SVGElement[] = [];
    const radius = 5 * this.pixel();
    const line = (points: Point[], kind: string, closed = true) => {
      // A dark line below a bright one is seen on any photograph.
      const d = path([points], closed);
      parts.push(svg("path", { d, class: "under" }), svg("path", { d, class: kind }));
    };
    const grips = (points: Point[], kind = "grip") => {
      for (const [cx, cy] of points) parts.push(svg("circle", { cx, cy, r: radius, class: kind }));
    };
    [...(guess?.outlines ?? [])].reverse().forEach((outline, i, all) => {
      const best = i === all.length - 1;
      const d = path(outline, true);
      if (best) parts.push(svg("path", { d, class: "under" }));
      parts.push(svg("path", { d, class: best ? `guess${this.rough ? " rough" : ""}` : "other" }));
    });
    if (hint.box) {
      line(boxCorners(hint), "drawn");
      if (tool === "box") grips(boxCorners(hint));
    }
    if (hint.axis) {
      line(axisCorners(hint.axis), "drawn strip");
      line([hint.axis.foot, hint.axis.top], "drawn", false);
      if (tool === "axis") grips([hint.axis.foot, hint.axis.top, ...axisSides(hint.axis)]);
    }
    if (hint.outline.length > 0) {
      line(hint.outline, "drawn");
      if (tool === "outline" && open.length === 0) grips(hint.outline);
    }
    if (open.length > 0) {
      line(open, "drawn", false);
      grips(open);
    }
    grips(hint.at, "on");
    grips(hint.not, "off");
    if (this.cross) {
      const [[x, y], r] = [this.cross, 3 * radius];
      line([[x - r, y], [x + r, y]], "cross", false);
      line([[x, y - r], [x, y + r]], "cross", false);
    }
    element.replaceChildren(...parts);
  }

  /** Says what the program sees there. */
  private describe(): void {
    const { guess, pointing } = this;
    let text = "";
    if (guess) {
      const score = guess.score < 1 ? ` ${Math.round(100 * guess.score)} %` : "";
      text = `${guess.source}${score}`;
    } else if (!isEmpty(pointing.hint)) {
      text = this.looking ? "looking …" : "nothing known here: a box tells more";
    }
    if (this.said.textContent !== text) this.said.textContent = text;
  }
}

/** The path of polygons or a line. */
function path(lines: Point[][], closed: boolean): string {
  const end = closed ? "Z" : "";
  return lines.map((points) => `M${points.map((p) => p.join(" ")).join("L")}${end}`).join("");
}
