// The selected choice: its statistics, its control, and its buttons.

import { ChoiceControl, type Change } from "./choice_control";
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
