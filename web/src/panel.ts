// The common parts of the tabs that show the program's answers.

import type { Actions, Known } from "./actions";
import { Latest } from "./connection";
import { ErrorBox } from "./errors";

/** A tab that follows the store while it is in sight, and asks again only for what changed. */
export abstract class Panel {
  abstract readonly element: HTMLElement;
  protected readonly error = new ErrorBox();
  protected readonly reads = new Latest<void>(() => this.read(), (e) => this.error.show(e));
  private visible = false;
  private shown = "";

  protected constructor(
    protected readonly actions: Actions,
    keys: (keyof Known)[],
  ) {
    actions.store.on(keys, () => this.follow());
  }

  /** The tab is shown, or no longer. */
  setVisible(visible: boolean): void {
    this.visible = visible;
    this.follow();
  }

  /** Shows what the store says at present. */
  protected abstract show(): void;

  /** Asks the program for the rest. */
  protected abstract read(): Promise<void>;

  protected follow(): void {
    if (this.visible) this.show();
  }

  /** True if the key differs from that of the call before. */
  protected isNew(key: string): boolean {
    const other = key !== this.shown;
    this.shown = key;
    return other;
  }
}
