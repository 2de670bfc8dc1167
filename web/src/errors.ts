// Errors, shown where they arose: the message, and the hint below it.

import { Disconnected, Refusal } from "./connection";
import { h } from "./dom";

/** The lines that explain an error. */
export function explain(error: unknown): { message: string; hint: string | null } {
  if (error instanceof Refusal) {
    // A diagnostic says more than its message, whose first part it repeats.
    const first = error.diagnostics[0];
    const whole = first?.message.startsWith(error.message) ? first.message : error.message;
    return { message: whole, hint: error.hint ?? first?.hint ?? null };
  }
  if (error instanceof Error) return { message: error.message, hint: null };
  return { message: String(error), hint: null };
}

/** True if there is nothing to draw, which is no mistake. */
export function isWithoutScene(error: unknown): boolean {
  return error instanceof Refusal && error.message.startsWith("the program has no view");
}

/** A place for an error, empty until one is shown. */
export class ErrorBox {
  readonly element = h("div", { class: "error-box", role: "alert", hidden: true });

  /** Shows an error; a lost connection has its own banner. */
  show(error: unknown): void {
    if (error instanceof Disconnected) return;
    const { message, hint } = explain(error);
    this.element.replaceChildren(h("pre", {}, message.replace(/^error: /, "")));
    if (hint) this.element.append(h("div", { class: "hint" }, hint));
    const close = h("button", { type: "button", class: "close", "aria-label": "Dismiss" }, "×");
    close.addEventListener("click", () => this.clear());
    this.element.append(close);
    this.element.hidden = false;
  }

  /** Removes the error. */
  clear(): void {
    this.element.hidden = true;
    this.element.replaceChildren();
  }

  /** Runs a task; its error is shown here, a success removes an earlier one. */
  async guard<T>(task: () => Promise<T>): Promise<T | undefined> {
    try {
      const result = await task();
      this.clear();
      return result;
    } catch (error) {
      this.show(error);
      return undefined;
    }
  }
}
