// The tab Compare: two runs beside each other, what differs most first.

import type { Actions } from "./actions";
import { fill, h, number, select, setOptions } from "./dom";
import { Panel } from "./panel";
import { PictureView } from "./picture_view";
import { hasBest, runName, type Comparison, type Statistics } from "./protocol";
import { StudioData } from "./studio_data";

/** Two runs: pictures in the same layer, settings, quantities. */
export class ComparePanel extends Panel {
  readonly element: HTMLElement;
  private a: string | null = null;
  /** The user chose the first run; otherwise it is the one looked at. */
  private isChosen = false;
  private b: string | null = null;
  private readonly selects = [
    select([], "", (run) => this.pick("a", run), { "aria-label": "First run" }),
    select([], "", (run) => this.pick("b", run), { "aria-label": "Second run" }),
  ] as const;
  private readonly left = new PictureView("overlay", (layer) => this.right.setLayer(layer));
  private readonly right = new PictureView("overlay");
  private readonly figures = h("div", { class: "figures" });
  private readonly tables = h("div");

  constructor(actions: Actions) {
    super(actions, ["runs", "run"]);
    this.element = h(
      "div",
      { class: "panel compare" },
      h("div", { class: "panel-tools" }, this.selects[0], "with", this.selects[1], this.left.tools),
      this.error.element,
      h("div", { class: "scroll" }, this.figures, this.tables),
    );
  }

  private pick(which: "a" | "b", run: string): void {
    this[which] = run;
    this.isChosen = true;
    this.show();
  }

  protected show(): void {
    const { runs, run } = this.actions.store.now;
    const usable = runs.filter(hasBest).map((r) => r.run);
    if (usable.length < 2) {
      fill(this.tables, h("div", { class: "empty" }, "Two runs with results can be compared."));
      fill(this.figures);
      return;
    }
    if (!this.a || !usable.includes(this.a) || !this.isChosen) {
      this.a = run && usable.includes(run) ? run : usable[usable.length - 1]!;
    }
    if (!this.b || !usable.includes(this.b) || this.b === this.a) {
      this.b = [...usable].reverse().find((r) => r !== this.a)!;
    }
    const options = usable.map((r): [string, string] => [r, runName(r)]);
    setOptions(this.selects[0], options, this.a);
    setOptions(this.selects[1], options, this.b);
    const version = (name: string) => {
      const found = runs.find((r) => r.run === name);
      return `${name} ${found?.state} ${found?.revision}`;
    };
    if (!this.isNew(`${version(this.a)} ${version(this.b)}`)) return;
    this.showPicture(this.left, this.a);
    this.showPicture(this.right, this.b);
    const figure = (view: PictureView, run: string) => {
      return h("figure", {}, view.element, h("figcaption", {}, runName(run)));
    };
    fill(this.figures, figure(this.left, this.a), figure(this.right, this.b));
    this.left.ask(0);
    this.right.ask(0);
    this.reads.call();
  }

  private showPicture(view: PictureView, run: string): void {
    const known = { ...this.actions.store.now, view: "best" as const, run };
    view.setData(new StudioData(this.actions.connection, known));
  }

  protected async read(): Promise<void> {
    const { a, b } = this;
    if (!a || !b) return;
    let data: Comparison;
    try {
      data = await this.actions.connection.ask<Comparison>("compare", { a, b });
    } catch (error) {
      fill(this.tables);
      throw error;
    }
    if (a !== this.a || b !== this.b) return;
    this.error.clear();
    fill(
      this.tables,
      h(
        "p",
        { class: "muted" },
        `${data.same_program ? "The same program" : "Different programs"}, `,
        data.same_data ? "the same data." : "different data.",
      ),
      settingsTable(runName(a), runName(b), data),
      quantitiesTable(runName(a), runName(b), data),
    );
  }
}

function settingsTable(a: string, b: string, { settings }: Comparison): HTMLElement {
  const cell = (own: string[], others: string[]) => {
    const texts = own.map((s) => h("code", { class: others.includes(s) ? "muted" : null }, s));
    return h("td", {}, h("div", { class: "codes" }, ...texts));
  };
  return h(
    "table",
    {},
    h("thead", {}, h("tr", {}, h("th", {}, `Settings of ${a}`), h("th", {}, `of ${b}`))),
    h("tbody", {}, h("tr", {}, cell(settings.a, settings.b), cell(settings.b, settings.a))),
  );
}

function quantitiesTable(a: string, b: string, { quantities }: Comparison): HTMLElement {
  const head = ["Quantity", `${a}: mean ± sd`, `${b}: mean ± sd`, "Apart"];
  const numeric = (text: string) => h("td", { class: "number" }, text);
  const rows = quantities.map((q) =>
    h(
      "tr",
      {},
      h("td", {}, h("code", {}, q.name)),
      numeric(meanAndSd(q.a)),
      numeric(meanAndSd(q.b)),
      numeric(number(q.apart, 3)),
    ),
  );
  const titles = head.map((t, i) => h("th", { class: i > 0 ? "number" : null }, t));
  titles[3]!.title = "The distance of the means in standard deviations";
  return h("table", {}, h("thead", {}, h("tr", {}, ...titles)), h("tbody", {}, ...rows));
}

function meanAndSd(statistics: Statistics | null): string {
  if (!statistics) return "–";
  return `${number(statistics.mean)} ± ${number(statistics.sd, 3)}`;
}
