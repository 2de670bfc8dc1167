// Building elements without a framework.

type Child = Node | string | null | undefined | false;
type Attributes = Record<string, unknown>;

/** Makes an element: attributes, `on…` handlers, and children. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on") && typeof value === "function") {
      element.addEventListener(name.slice(2), value as EventListener);
    } else if (name === "value" && "value" in element) {
      (element as HTMLInputElement).value = String(value);
    } else {
      element.setAttribute(name, value === true ? "" : String(value));
    }
  }
  append(element, ...children);
  return element;
}

/** Appends children, without those that are absent. */
export function append(parent: Element, ...children: Child[]): void {
  for (const child of children) {
    if (child !== null && child !== undefined && child !== false) parent.append(child);
  }
}

/** Replaces all children. */
export function fill(parent: Element, ...children: Child[]): void {
  parent.replaceChildren();
  append(parent, ...children);
}

/** A button with a text, a handler and a tooltip. */
export function button(
  text: string,
  onclick: () => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  return h("button", { type: "button", onclick, ...attributes }, text);
}

/** A field for words that lines must have; the callback gets them in lower case. */
export function filterField(
  label: string,
  placeholder: string,
  onwords: (words: string[]) => void,
): HTMLInputElement {
  const field = h("input", { type: "search", placeholder, "aria-label": label });
  field.addEventListener("input", () => {
    onwords(field.value.toLowerCase().split(/\s+/).filter(Boolean));
  });
  return field;
}

/** Pairs of name and value below each other, without those of which nothing is known. */
export function factList(facts: [string, string][]): HTMLElement {
  const known = facts.filter(([, value]) => value !== "–");
  const rows = known.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)));
  return h("dl", {}, ...rows);
}

/** A select; options are names, or pairs of value and name. */
export function select(
  options: (string | [string, string])[],
  value: string,
  onchange: (value: string) => void,
  attributes: Attributes = {},
): HTMLSelectElement {
  const element = h("select", attributes);
  setOptions(element, options, value);
  element.addEventListener("change", () => onchange(element.value));
  return element;
}

/** Replaces a select's options if they differ, and its value. */
export function setOptions(
  element: HTMLSelectElement,
  options: (string | [string, string])[],
  value: string,
): void {
  const pairs = options.map((o) => (typeof o === "string" ? ([o, o] as const) : o));
  const same =
    pairs.length === element.options.length &&
    pairs.every(([v, n], i) => element.options[i]!.value === v && element.options[i]!.text === n);
  if (!same) fill(element, ...pairs.map(([v, n]) => h("option", { value: v }, n)));
  if (element.value !== value) element.value = value;
}

/** A group of buttons of which one is pressed. */
export class Segments {
  readonly element: HTMLElement;
  private buttons = new Map<string, HTMLButtonElement>();

  constructor(
    label: string,
    options: [string, string][],
    private chosen: string,
    onchange: (value: string) => void,
  ) {
    this.element = h("div", { class: "segments", role: "group", "aria-label": label });
    for (const [value, name] of options) {
      const press = () => {
        if (this.chosen === value) return;
        this.value = value;
        onchange(value);
      };
      const element = button(name, press, { "data-value": value });
      this.buttons.set(value, element);
      this.element.append(element);
    }
    this.value = chosen;
  }

  get value(): string {
    return this.chosen;
  }

  set value(value: string) {
    this.chosen = value;
    for (const [v, b] of this.buttons) b.setAttribute("aria-pressed", String(v === value));
  }

  /** Enables or disables one of the buttons. */
  enable(value: string, enabled: boolean): void {
    const element = this.buttons.get(value);
    if (element) element.disabled = !enabled;
  }
}

/** A number with about four significant digits, as the program prints them. */
export function number(x: number | null | undefined, digits = 4): string {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e6 || size < 1e-4) return x.toExponential(digits - 1);
  return String(Number(x.toPrecision(digits))).replace("-", "\u2212");
}

/** A duration in words: `7 s`, `3 min 20 s`, `2 h 5 min`. */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}
