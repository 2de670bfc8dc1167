// The selected choice: its statistics, its buttons, and the control with which it is changed:
// sliders for numbers, buttons for the rest.

import { button, fill, h, number } from "./dom";
import type { Choice, Value } from "./protocol";

/** The lower part of the tab Trace. */
export class SelectedChoice {
  readonly element = h("div", { class: "selected", hidden: true });
  private choice: Choice | null = null;
  private readonly title = h("div", { class: "selected-title" });
  private readonly about = h("div", { class: "muted" });
  private readonly answer = h("pre", { class: "answer", hidden: true });
  private readonly control: ChoiceControl;
  private readonly buttons: HTMLElement;
  private readonly force = button("Force", () => this.forceValue());
  private readonly freeze = button("Freeze", () => this.sayOf(`freeze ${this.choice?.address};`));

  constructor(
    change: Change,
    private readonly enter: (text: string) => void,
    why: (address: string) => void,
  ) {
    this.control = new ChoiceControl(change);
    this.force.title = "Start the chains of the program's runs at this value";
    this.freeze.title = "Propose no other value for it in the program's runs";
    this.buttons = h(
      "div",
      { class: "buttons" },
      button("Flip", () => this.sayOf(`:flip ${this.choice?.address}`), {
        title: "Propose another value from the prior",
      }),
      this.force,
      this.freeze,
      button("Why?", () => this.choice && why(this.choice.address), {
        title: "What it depends on, and what depends on it",
      }),
    );
    this.element.append(
      this.title,
      this.about,
      this.control.element,
      this.buttons,
      this.answer,
    );
  }

  /** Shows a choice; only one of the session's state can be changed. */
  show(choice: Choice | null, editable: boolean): void {
    if (choice?.address !== this.choice?.address) this.answer.hidden = true;
    this.choice = choice;
    this.element.hidden = choice === null;
    if (!choice) {
      this.control.show(null);
      return;
    }
    const parts = [
      `drawn from ${choice.family}`,
      choice.support,
      `log density ${number(choice.log_density)}`,
      choice.acceptance === null ? null : `${Math.round(100 * choice.acceptance)}% accepted`,
    ];
    fill(
      this.title,
      h("code", {}, choice.address),
      h("span", { class: "muted" }, choice.tags.map((t) => `#${t}`).join(" ")),
    );
    fill(this.about, parts.filter(Boolean).join(" · "));
    this.freeze.disabled = choice.frozen;
    this.buttons.hidden = !editable;
    this.control.element.hidden = !editable;
    this.control.show(choice);
    if (!editable) this.about.append(" · choose “Session” above the picture to change it");
  }

  /** Shows what the program said about the choice. */
  say(text: string): void {
    this.answer.textContent = text;
    this.answer.hidden = text === "";
  }

  /** Ends a drag. */
  stop(): void {
    this.control.stop();
  }

  /** Puts the keyboard's focus on the control. */
  focus(): void {
    this.control.element.querySelector<HTMLElement>("input, button")?.focus();
  }

  private sayOf(text: string): void {
    if (this.choice) this.enter(text);
  }

  private forceValue(): void {
    const choice = this.choice;
    if (choice) this.enter(`force ${choice.address} = ${literal(choice.value)};`);
  }
}

/** A value as a program writes it. */
function literal(value: Value): string {
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  return typeof value === "string" ? JSON.stringify(value) : String(value);
}

/** The range of a slider: the support, or four standard deviations around the value. */
export function sliderRange(choice: Choice, value: number): [number, number] {
  const scale = choice.scale && choice.scale > 0 ? choice.scale : Math.max(1, Math.abs(value));
  const low = choice.low ?? Math.min(value, choice.high ?? value) - 4 * scale;
  const high = choice.high ?? Math.max(value, choice.low ?? value) + 4 * scale;
  return low < high ? [low, high] : [low - 1, low + 1];
}

/** The values a choice can have if there are at most twelve: booleans, small integers, words. */
export function discreteValues(choice: Choice): Value[] | null {
  if (typeof choice.value === "boolean") return [false, true];
  if (typeof choice.value === "string") {
    const words = [...(choice.support ?? "").matchAll(/"([^"]*)"/g)].map((m) => m[1]!);
    return words.length > 0 ? words : [choice.value];
  }
  const { low, high } = choice;
  if (isWhole(choice) && low !== null && high !== null && high - low <= 11) {
    return Array.from({ length: high - low + 1 }, (_, i) => low + i);
  }
  return null;
}

function isWhole(choice: Choice): boolean {
  return typeof choice.value === "number" && /integer|whole|natural/.test(choice.support ?? "");
}

/** Called by a moved control: `last` when the user let go, `drag` if the changes before it
 * belong to the same movement. */
export type Change = (value: Value, move: { last: boolean; drag: boolean }) => void;

type Apply = (x: number, move: { last: boolean; drag: boolean }, from: HTMLElement) => void;

/** A control for one choice; it calls back while and after it is moved. */
export class ChoiceControl {
  readonly element = h("div", { class: "control" });
  private choice: Choice | null = null;
  private moving = false;
  private updates: ((value: Value) => void)[] = [];

  constructor(private readonly change: Change) {}

  /** Shows a choice; while it is dragged its controls stay as they are. */
  show(choice: Choice | null): void {
    const before = this.choice;
    if (this.moving && before?.address === choice?.address) return;
    this.choice = choice;
    if (choice && before && sameShape(before, choice) && this.updates.length > 0) {
      for (const update of this.updates) update(choice.value);
      return;
    }
    this.updates = [];
    if (!choice) fill(this.element);
    else fill(this.element, this.controlFor(choice));
  }

  /** Ends a drag, if the control was removed in the middle of one. */
  stop(): void {
    this.moving = false;
  }

  private controlFor(choice: Choice): HTMLElement {
    const values = discreteValues(choice);
    if (values) return this.buttonsFor(values);
    if (typeof choice.value === "number") {
      return this.sliderFor(choice, "", () => this.choice?.value ?? 0, (x) => x);
    }
    if (Array.isArray(choice.value)) return this.arrayFor(choice, choice.value);
    return h("p", { class: "muted" }, "A value of this kind is changed at the prompt.");
  }

  private buttonsFor(values: Value[]): HTMLElement {
    const group = h("div", { class: "segments", role: "group", "aria-label": "Value" });
    const buttons = values.map((value) => {
      return button(String(value), () => this.change(value, { last: true, drag: false }));
    });
    group.append(...buttons);
    const update = (now: Value) => {
      buttons.forEach((b, i) => b.setAttribute("aria-pressed", String(values[i] === now)));
    };
    update(this.choice!.value);
    this.updates.push(update);
    return group;
  }

  private arrayFor(choice: Choice, value: Value[]): HTMLElement {
    const list = h("div", { class: "elements" });
    const visit = (part: Value[], path: number[]) => {
      part.forEach((x, i) => {
        const at = [...path, i];
        if (Array.isArray(x)) visit(x, at);
        else if (typeof x === "number") {
          const get = () => elementAt(this.choice?.value ?? 0, at);
          const put = (y: number) => withElement(this.choice!.value, at, y);
          list.append(this.sliderFor(choice, `[${at.join(", ")}]`, get, put));
        }
      });
    };
    visit(value, []);
    return list;
  }

  private sliderFor(
    choice: Choice,
    name: string,
    get: () => Value,
    put: (x: number) => Value,
  ): HTMLElement {
    const label = `${choice.address}${name}`;
    const value = Number(get());
    const [low, high] = sliderRange(choice, value);
    const whole = isWhole(choice);
    const step = whole ? 1 : (high - low) / 1000;
    const slider = h("input", {
      type: "range",
      min: low,
      max: high,
      step: whole ? 1 : "any",
      value,
      "aria-label": label,
    });
    const field = h("input", {
      type: "text",
      inputmode: "decimal",
      class: "scrub",
      "aria-label": `Value of ${label}`,
      title: "Type a value, or drag sideways",
    });
    field.value = number(value, 5);
    const apply: Apply = (x, move, from) => {
      if (!Number.isFinite(x)) return;
      const { last } = move;
      const y = whole ? Math.round(x) : x;
      this.moving = !last;
      if (from !== slider) slider.value = String(y);
      if (from !== field || last || move.drag) field.value = number(y, 5);
      const next = put(y);
      if (this.choice) this.choice = { ...this.choice, value: next };
      this.change(next, move);
    };
    const slide = (last: boolean) => apply(Number(slider.value), { last, drag: true }, slider);
    slider.addEventListener("input", () => slide(false));
    slider.addEventListener("change", () => slide(true));
    slider.addEventListener("keydown", (event) => arrow(event, slider, step, apply));
    field.addEventListener("change", () => {
      apply(Number(field.value.replace("\u2212", "-")), { last: true, drag: false }, field);
    });
    scrub(field, step, () => Number(get()), (x, last) => apply(x, { last, drag: true }, field));
    this.updates.push((now) => {
      const all = this.choice;
      this.choice = all ? { ...all, value: now } : all;
      const x = Number(get());
      if (x < Number(slider.min)) slider.min = String(x);
      if (x > Number(slider.max)) slider.max = String(x);
      slider.value = String(x);
      if (document.activeElement !== field) field.value = number(x, 5);
    });
    return h("div", { class: "slider" }, name ? h("code", {}, name) : null, slider, field);
  }
}

// A slider with the step `any` moves by a tenth of its range at each arrow key: too far.
function arrow(
  event: KeyboardEvent,
  slider: HTMLInputElement,
  step: number,
  apply: Apply,
): void {
  const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
  if (!by) return;
  event.preventDefault();
  const x = Number(slider.value) + by * step * (event.shiftKey ? 50 : 5);
  slider.value = String(Math.min(Number(slider.max), Math.max(Number(slider.min), x)));
  apply(Number(slider.value), { last: true, drag: true }, slider);
}

/** Dragging sideways over a field changes its number, as in Blender. */
function scrub(
  field: HTMLInputElement,
  step: number,
  get: () => number,
  apply: (x: number, last: boolean) => void,
): void {
  field.addEventListener("pointerdown", (down) => {
    if (document.activeElement === field || down.button !== 0) return;
    down.preventDefault();
    const start = get();
    let moved = false;
    let last = start;
    field.setPointerCapture(down.pointerId);
    const move = (event: PointerEvent) => {
      const by = event.clientX - down.clientX;
      if (!moved && Math.abs(by) < 3) return;
      moved = true;
      last = start + by * step * (event.shiftKey ? 0.2 : 2);
      apply(last, false);
    };
    const up = () => {
      field.removeEventListener("pointermove", move);
      field.removeEventListener("pointerup", up);
      field.removeEventListener("pointercancel", up);
      if (moved) apply(last, true);
      else {
        field.focus();
        field.select();
      }
    };
    field.addEventListener("pointermove", move);
    field.addEventListener("pointerup", up);
    field.addEventListener("pointercancel", up);
  });
}

function sameShape(a: Choice, b: Choice): boolean {
  const length = (v: Value) => (Array.isArray(v) ? JSON.stringify(v).split(",").length : 0);
  return (
    a.address === b.address &&
    a.family === b.family &&
    typeof a.value === typeof b.value &&
    length(a.value) === length(b.value)
  );
}

function elementAt(value: Value, path: number[]): Value {
  return path.reduce<Value>((v, i) => (Array.isArray(v) ? (v[i] ?? 0) : v), value);
}

function withElement(value: Value, path: number[], x: number): Value {
  const [i, ...rest] = path;
  if (i === undefined || !Array.isArray(value)) return x;
  return value.map((v, k) => (k === i ? withElement(v, rest, x) : v));
}
