// Limbs over the picture: the landmarks of the session's scene, of which the user drags one while
// the program moves the body after it.

import type { Actions } from "./actions";
import { Latest } from "./connection";
import { button } from "./dom";
import { ErrorBox } from "./errors";
import type { PictureView } from "./picture_view";
import type { Joint, Joints, Moved, Point } from "./protocol";
import { svg } from "./svg";

const ABOUT =
  "Drag a joint of the session's state, and the limb follows; Tab and the arrow keys do the same. " +
  "One undo takes back a drag";
/** How near a press is to the joint that it means, in CSS pixels. */
const NEAR = { mouse: 12, touch: 24 };
/** How far an arrow key pulls, as a part of the picture's longer side. */
const STEP = 0.01;

interface Pull {
  joint: string;
  at: Point;
  last: boolean;
}

/** Shows and drags the joints of the session's state. */
export class LimbLayer {
  readonly toggle: HTMLButtonElement;
  readonly element: SVGSVGElement;
  /** Called when the joints are shown. */
  onShow: () => void = () => {};
  private shown = false;
  private joints: Joint[] = [];
  private size: Point = [1, 1];
  /** The joint that is dragged, and where to. */
  private held: { name: string; to: Point } | null = null;
  /** The drag has begun: its changes join. */
  private begun = false;
  private readonly marks = new Map<string, SVGCircleElement>();
  private readonly line = svg("path", { class: "pull" });
  private readonly error = new ErrorBox();
  private readonly reads = new Latest<void>(() => this.read(), () => this.take(null));
  private readonly pulls = new Latest<Pull>((pull) => this.send(pull), (e) => this.fail(e));

  constructor(
    private readonly actions: Actions,
    private readonly pictures: PictureView,
  ) {
    this.toggle = button("Limbs", () => this.show(!this.shown), {
      title: ABOUT,
      "aria-pressed": "false",
    });
    this.element = svg("svg", {
      class: "limb-layer",
      role: "group",
      "aria-label": "Joints",
      preserveAspectRatio: "xMidYMid meet",
    });
    this.element.append(this.line);
    pictures.tools.append(this.toggle);
    pictures.element.append(this.element, this.error.element);
    this.listen();
    pictures.onLook.push(() => this.draw());
    new ResizeObserver(() => this.draw()).observe(pictures.element);
    actions.store.on(["session", "view"], () => this.follow());
    this.follow();
  }

  /** Shows the joints, or not. */
  show(wanted: boolean): void {
    if (wanted === this.shown) return;
    this.shown = wanted;
    if (wanted) {
      this.onShow();
      this.actions.store.set({ view: "session", at: null });
      this.pictures.seeFromCamera();
    }
    this.toggle.setAttribute("aria-pressed", String(wanted));
    this.draw();
  }

  /** The session or its state changed. */
  private follow(): void {
    const { session, view } = this.actions.store.now;
    if (view !== "session") this.show(false);
    if (!session?.has_view) this.take(null);
    else if (!this.held) this.reads.call();
  }

  private async read(): Promise<void> {
    const session = this.actions.store.now.session?.session;
    if (session === undefined) return;
    const answer = await this.actions.connection.ask<Joints>("joints", { session });
    if (!this.held && session === this.actions.store.now.session?.session) this.take(answer);
  }

  private take(answer: Joints | null): void {
    this.joints = answer?.joints ?? [];
    this.toggle.hidden = this.joints.length === 0;
    if (answer) this.size = [answer.width, answer.height];
    else this.show(false);
    this.draw();
  }

  private async send({ joint, at, last }: Pull): Promise<void> {
    const params = { joint, at, drag: this.begun };
    this.begun = true;
    const answer = await this.actions.drag<Moved & { joints: Joint[] }>("pull", params, last);
    this.error.clear();
    if (answer) this.joints = answer.joints;
    if (last) this.end();
    else this.draw();
  }

  private fail(error: unknown): void {
    this.error.show(error);
    this.end();
  }

  private end(): void {
    this.held = null;
    this.actions.store.set({ dragging: false });
    this.actions.refreshSession();
    this.follow();
    this.draw();
  }

  private pull(at: Point, last: boolean): void {
    if (!this.held) return;
    this.held.to = at;
    this.pulls.call({ joint: this.held.name, at, last });
    this.draw();
  }

  /** The user took hold of a joint. */
  private grab(joint: Joint): void {
    this.held = { name: joint.name, to: joint.at };
    this.begun = false;
    this.actions.store.set({ dragging: true });
  }

  private listen(): void {
    const { element } = this;
    let pointer: number | null = null;
    /** From the pointer to the joint that it holds: a joint does not jump when it is taken. */
    let apart: Point = [0, 0];
    let moved = false;
    element.addEventListener("pointerdown", (event) => {
      const joint = this.nearest(event);
      if (!joint || pointer !== null || event.button !== 0 || this.held) return;
      event.preventDefault();
      pointer = event.pointerId;
      element.setPointerCapture(pointer);
      const [x, y] = this.position(event);
      apart = [joint.at[0] - x, joint.at[1] - y];
      moved = false;
      this.grab(joint);
      this.marks.get(joint.name)?.focus({ preventScroll: true });
      this.draw();
    });
    const to = (event: PointerEvent): Point => {
      const [x, y] = this.position(event);
      return [x + apart[0], y + apart[1]];
    };
    element.addEventListener("pointermove", (event) => {
      if (event.pointerId === pointer) {
        moved = true;
        this.pull(to(event), false);
      } else if (pointer === null) {
        element.style.cursor = this.nearest(event) ? "grab" : "";
      }
    });
    const release = (event: PointerEvent) => {
      if (event.pointerId !== pointer) return;
      pointer = null;
      if (moved && this.held) this.pull(event.type === "pointerup" ? to(event) : this.held.to, true);
      else this.end();
    };
    element.addEventListener("pointerup", release);
    element.addEventListener("pointercancel", release);
  }

  private key(event: KeyboardEvent, name: string): void {
    const arrows: Record<string, Point> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const [dx, dy] = arrows[event.key] ?? [0, 0];
    const joint = this.joints.find((j) => j.name === name);
    if ((dx === 0 && dy === 0) || !joint || this.held) return;
    event.preventDefault();
    const by = STEP * Math.max(...this.size) * (event.shiftKey ? 5 : 1);
    this.grab(joint);
    this.pull([joint.at[0] + by * dx, joint.at[1] + by * dy], true);
  }

  /** The joint that an event means. */
  private nearest(event: PointerEvent): Joint | null {
    const [x, y] = this.position(event);
    const reach = (event.pointerType === "mouse" ? NEAR.mouse : NEAR.touch) * this.pixel();
    const away = ({ at }: Joint) => Math.hypot(at[0] - x, at[1] - y);
    const near = this.joints.filter((joint) => away(joint) < reach);
    return near.sort((a, b) => away(a) - away(b))[0] ?? null;
  }

  private position(event: PointerEvent): Point {
    const matrix = this.element.getScreenCTM();
    if (!matrix) return [0, 0];
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    return [at.x, at.y];
  }

  /** The size of a CSS pixel, in pixels of the picture. */
  private pixel(): number {
    const { clientWidth, clientHeight } = this.pictures.element;
    const scale = Math.min(clientWidth / this.size[0], clientHeight / this.size[1]);
    return scale > 0 ? 1 / scale : 1;
  }

  private draw(): void {
    const { element, held } = this;
    const visible = this.shown && this.pictures.fromCamera;
    element.style.display = visible ? "" : "none";
    if (!visible) return;
    element.setAttribute("viewBox", `0 0 ${this.size.join(" ")}`);
    element.classList.toggle("holding", held !== null);
    const known = new Set(this.joints.map(({ name }) => name));
    for (const [name, mark] of this.marks) {
      if (known.has(name)) continue;
      mark.remove();
      this.marks.delete(name);
    }
    for (const { name, at } of this.joints) {
      const mark = this.marks.get(name) ?? this.mark(name);
      mark.setAttribute("cx", String(at[0]));
      mark.setAttribute("cy", String(at[1]));
      mark.setAttribute("r", String(4.5 * this.pixel()));
      mark.classList.toggle("held", held?.name === name);
    }
    const from = held && this.joints.find((joint) => joint.name === held.name);
    this.line.setAttribute("d", held && from ? `M${from.at.join(" ")}L${held.to.join(" ")}` : "");
  }

  private mark(name: string): SVGCircleElement {
    const title = svg("title", {});
    title.textContent = name.replaceAll("_", " ");
    const attributes = { tabindex: 0, role: "button", "aria-label": name, "data-joint": name };
    const mark = svg("circle", attributes);
    mark.append(title);
    mark.addEventListener("keydown", (event) => this.key(event, name));
    this.marks.set(name, mark);
    this.element.append(mark);
    return mark;
  }
}
