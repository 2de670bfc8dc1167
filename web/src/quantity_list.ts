// The list from which quantities are chosen, with their R-hat and effective sample size.

import { button, filterField, h, number } from "./dom";
import type { Statistics } from "./protocol";
import { VirtualList } from "./virtual_list";

const BAD_R_HAT = 1.05;

/** A filterable list of quantities with check boxes. */
export class QuantityList {
  readonly element: HTMLElement;
  private quantities: Record<string, Statistics> = {};
  private names: string[] = [];
  private chosen = new Set<string>();
  private untouched = true;
  private words: string[] = [];
  private readonly list = new VirtualList(24, (i) => this.line(this.names[i]!));

  constructor(private readonly onChange: () => void) {
    const filter = filterField("Filter quantities", "Filter quantities", (words) => {
      this.words = words;
      this.draw();
    });
    const none = button("None", () => this.choose([]), { title: "Choose none" });
    const worst = button("Worst", () => this.choose(this.worst()), {
      title: "Choose the four with the largest R-hat",
    });
    this.element = h(
      "div",
      { class: "quantities" },
      h("div", { class: "panel-tools" }, filter, worst, none),
      h(
        "div",
        { class: "quantity head", "aria-hidden": "true" },
        h("span", {}, "Quantity"),
        h("span", {}, "mean"),
        h("span", {}, "sd"),
        h("span", {}, "R-hat"),
        h("span", {}, "ESS"),
      ),
      this.list.element,
    );
  }

  /** The names of the chosen quantities that exist. */
  selected(): string[] {
    return [...this.chosen].filter((name) => name in this.quantities);
  }

  /** Shows quantities; at first some are chosen. */
  update(quantities: Record<string, Statistics>): void {
    this.quantities = quantities;
    if (this.untouched) {
      this.chosen = new Set(Object.keys(quantities).slice(0, 3));
    }
    this.draw();
  }

  private choose(names: string[]): void {
    this.untouched = false;
    this.chosen = new Set(names);
    this.draw();
    this.onChange();
  }

  private worst(): string[] {
    const of = (name: string) => this.quantities[name]?.r_hat ?? 0;
    return Object.keys(this.quantities)
      .sort((a, b) => of(b) - of(a))
      .slice(0, 4);
  }

  private draw(): void {
    this.names = Object.keys(this.quantities).filter((name) => {
      const lower = name.toLowerCase();
      return this.words.every((word) => lower.includes(word));
    });
    this.element.style.setProperty("--rows", String(this.names.length));
    this.list.update(this.names.length);
  }

  private line(name: string): HTMLElement {
    const s = this.quantities[name] ?? {};
    const box = h("input", { type: "checkbox" });
    box.checked = this.chosen.has(name);
    box.addEventListener("change", () => {
      this.untouched = false;
      if (box.checked) this.chosen.add(name);
      else this.chosen.delete(name);
      this.onChange();
    });
    const bad = (s.r_hat ?? 1) > BAD_R_HAT;
    const ess = s.ess_bulk ?? null;
    return h(
      "label",
      { class: "row quantity" },
      h("span", {}, box, h("code", {}, name)),
      h("span", {}, number(s.mean)),
      h("span", {}, number(s.sd, 3)),
      h("span", { class: bad ? "failed" : null }, number(s.r_hat, 3)),
      h("span", {}, ess === null ? "–" : String(Math.round(ess))),
    );
  }
}
