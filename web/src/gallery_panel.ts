// The tab Gallery: the cases of an `evaluate` folder, failures and doubtful ones first.

import type { Actions } from "./actions";
import { factList, fill, h, number, select, setOptions, duration } from "./dom";
import { Panel } from "./panel";
import type { Case } from "./protocol";

type Order = "failures" | "doubt" | "score" | "name";

const ORDERS: [Order, string][] = [
  ["failures", "Failures first"],
  ["doubt", "Most doubtful first"],
  ["score", "Lowest score first"],
  ["name", "By name"],
];

/** Cards of cases. */
export class GalleryPanel extends Panel {
  readonly element: HTMLElement;
  private cases: Case[] = [];
  private order: Order = "failures";
  private folder = "";
  private readonly cards = h("div", { class: "cards scroll" });
  private readonly count = h("span", { class: "muted" });
  private readonly folders = select([], "", (folder) => this.open(folder), {
    "aria-label": "Folder of an evaluation",
  });

  constructor(actions: Actions) {
    super(actions, ["folder"]);
    const orders = select(ORDERS, this.order, (order) => {
      this.order = order as Order;
      this.draw();
    }, { "aria-label": "Order" });
    this.element = h(
      "div",
      { class: "panel" },
      h("div", { class: "panel-tools" }, this.folders, orders, this.count),
      this.error.element,
      this.cards,
    );
  }

  protected show(): void {
    const folders = this.actions.store.now.folder?.evaluations ?? [];
    this.folders.hidden = folders.length === 0;
    if (folders.length === 0) {
      const text = "No results of `pcadlang evaluate` lie in this folder.";
      fill(this.cards, h("div", { class: "empty" }, text));
      return;
    }
    const folder = folders.includes(this.folder) ? this.folder : folders[0]!;
    setOptions(this.folders, folders, folder);
    this.open(folder);
  }

  private open(folder: string): void {
    this.folder = folder;
    this.reads.call();
  }

  protected async read(): Promise<void> {
    const { folder } = this;
    const params = { folder };
    const answer = await this.actions.connection.ask<{ cases: Case[] }>("evaluation", params);
    if (folder !== this.folder) return;
    this.error.clear();
    this.cases = answer.cases;
    this.draw();
  }

  private draw(): void {
    const failed = this.cases.filter((c) => c.error !== null).length;
    this.count.textContent = `${this.cases.length} cases, ${failed} failed`;
    fill(this.cards, ...sortCases(this.cases, this.order).map((c) => this.card(c)));
  }

  private card(c: Case): HTMLElement {
    const file = c.overlay ?? c.picture;
    const src = file ? this.actions.connection.fileAddress(file) : null;
    const image = src ? h("img", { src, alt: `Overlay of ${c.name}`, loading: "lazy" }) : null;
    const facts: [string, string][] = [
      ["score", number(c.score, 3)],
      ["doubt", number(c.doubt, 3)],
      ["R-hat", number(c.r_hat, 3)],
      ["time", duration(c.seconds)],
    ];
    return h(
      "article",
      { class: c.error ? "card failed-card" : "card" },
      h("div", { class: "thumb" }, image),
      h("h3", {}, c.name, c.error ? h("span", { class: "state failed" }, c.state) : null),
      c.error ? h("pre", { class: "failed" }, c.error) : factList(facts),
    );
  }
}

/** Cases in an order; `failures` is that of the program. */
function sortCases(cases: Case[], order: Order): Case[] {
  const last = (x: number | null, sign: number) => (x === null ? Infinity : sign * x);
  const keys: Record<Order, (a: Case, b: Case) => number> = {
    failures: () => 0,
    doubt: (a, b) => compare(last(a.doubt, -1), last(b.doubt, -1)),
    score: (a, b) => compare(last(a.score, 1), last(b.score, 1)),
    name: (a, b) => a.name.localeCompare(b.name, "en", { numeric: true }),
  };
  return [...cases].sort(keys[order]);
}

function compare(a: number, b: number): number {
  return a < b ? -1 : a > b ? 1 : 0;
}
