// The tab Modes: the best state of each mode as a picture, and how probable the modes are.

import type { Actions } from "./actions";
import { factList, fill, h, number } from "./dom";
import { Panel } from "./panel";
import { isLive, type Mode, type Summary } from "./protocol";
import { askPicture } from "./studio_data";

/** Modes as cards; a click shows one in the viewer. */
export class ModesPanel extends Panel {
  readonly element: HTMLElement;
  private readonly cards = h("div", { class: "cards scroll" });

  constructor(actions: Actions) {
    super(actions, ["runs", "run", "modes"]);
    this.element = h("div", { class: "panel" }, this.error.element, this.cards);
    actions.store.on(["view", "at"], () => this.mark());
  }

  protected show(): void {
    const run = this.actions.store.currentRun;
    if (!run || isLive(run) || run.state === "failed") {
      this.isNew("");
      const text = run ? "Modes are known when the run has ended." : "Modes are those of a run.";
      fill(this.cards, h("div", { class: "empty" }, text));
      return;
    }
    if (this.isNew(`${run.run} ${run.state} ${run.draws}`)) this.reads.call();
  }

  protected async read(): Promise<void> {
    const { connection, store } = this.actions;
    const now = store.currentRun;
    if (!now) return;
    const { run, draws } = now;
    const { modes } = await connection.ask<Summary>("summary", { run });
    if (store.now.run !== run) return;
    this.error.clear();
    if (modes.length === 0) {
      const text = draws
        ? "All chains are in one mode: the viewer has its best state."
        : "The run has no modes: it kept no draws.";
      fill(this.cards, h("div", { class: "empty" }, text));
      return;
    }
    const cards = modes.map((mode, i) => this.card(mode, i));
    fill(this.cards, ...cards.map(({ element }) => element));
    this.mark();
    for (const [mode, { image }] of cards.entries()) {
      try {
        const { url } = await askPicture(connection, { run, mode }, "overlay", 320);
        if (store.now.run !== run) return;
        image.src = url;
        image.addEventListener("load", () => URL.revokeObjectURL(url), { once: true });
      } catch (error) {
        this.error.show(error);
      }
    }
  }

  private card(mode: Mode, index: number) {
    const image = h("img", { alt: `The best state of mode ${index + 1}` });
    const facts: [string, string][] = [
      ["probability", number(mode.probability, 3)],
      ["chains", chainsOf(mode)],
      ["log joint", number(mode.log_joint)],
      ["log evidence", evidence(mode)],
    ];
    const show = () => this.actions.store.set({ view: "modes", at: index });
    const element = h(
      "button",
      { type: "button", class: "card", onclick: show },
      h("div", { class: "thumb" }, image),
      h("h3", {}, `Mode ${index + 1}`),
      factList(facts),
    );
    return { element, image };
  }

  private mark(): void {
    const { view, at } = this.actions.store.now;
    [...this.cards.querySelectorAll("button.card")].forEach((card, i) => {
      card.setAttribute("aria-pressed", String(view === "modes" && i === (at ?? 0)));
    });
  }
}

function chainsOf({ chains, share }: Mode): string {
  const list = chains?.join(", ");
  return list ? `${list} (${Math.round(100 * (share ?? 0))}%)` : number(share, 3);
}

function evidence({ log_evidence }: Mode): string {
  return log_evidence ? `${number(log_evidence[0])} ± ${number(log_evidence[1], 2)}` : "–";
}
