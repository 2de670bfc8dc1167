// The tab Plots: traces, ranks, pairs and intervals of the chosen quantities of a run.

import type { Actions } from "./actions";
import { fill, h, Segments } from "./dom";
import { Panel } from "./panel";
import { interval, type Interval } from "./plot_data";
import { densityPlot } from "./plot_density";
import { forestPlot } from "./plot_forest";
import { MOST_PAIRS, pairsPlot } from "./plot_pairs";
import { rankPlot } from "./plot_rank";
import { tracePlot } from "./plot_trace";
import type { Quantity, Statistics, Summary } from "./protocol";
import { QuantityList } from "./quantity_list";

const KINDS: [string, string][] = [
  ["trace", "Traces"],
  ["density", "Densities"],
  ["rank", "Ranks"],
  ["pairs", "Pairs"],
  ["forest", "Intervals"],
];
// Plots of one quantity each.
type Plot = (quantity: Quantity, width: number, every: number) => HTMLElement;
const SINGLE: Record<string, Plot> = { trace: tracePlot, density: densityPlot, rank: rankPlot };
const MOST_PLOTS = 40;
const WAIT = 3000;

/** Plots of the run that is looked at; while it runs they follow. */
export class PlotsPanel extends Panel {
  readonly element: HTMLElement;
  private readonly kinds: Segments;
  private readonly list: QuantityList;
  private readonly plots = h("div", { class: "plots scroll" });
  private statistics: Record<string, Statistics> = {};
  private data: { quantities: Quantity[]; every: number } | null = null;
  private askedFor = "";
  private askedAt = 0;
  private later: ReturnType<typeof setTimeout> | null = null;

  constructor(actions: Actions) {
    super(actions, ["runs", "run"]);
    this.kinds = new Segments("Kind of plot", KINDS, "trace", () => this.draw());
    this.list = new QuantityList(() => this.reads.call());
    this.element = h(
      "div",
      { class: "panel" },
      this.list.element,
      h("div", { class: "panel-tools" }, this.kinds.element),
      this.error.element,
      this.plots,
    );
    let width = 0;
    new ResizeObserver(() => {
      // Plots have the panel's width; drawing them does not change it.
      if (this.plots.clientWidth !== width) this.draw();
      width = this.plots.clientWidth;
    }).observe(this.plots);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  protected show(): void {
    const run = this.actions.store.currentRun;
    const key = run ? `${run.run} ${run.draws} ${run.state}` : "";
    if (key === this.askedFor) return;
    const wait = this.askedAt + WAIT - Date.now();
    const other = this.askedFor.split(" ")[0] !== run?.run;
    if (wait > 0 && !other) {
      this.later ??= setTimeout(() => {
        this.later = null;
        this.follow();
      }, wait);
      return;
    }
    this.askedFor = key;
    this.askedAt = Date.now();
    this.reads.call();
  }

  protected async read(): Promise<void> {
    const { store, connection } = this.actions;
    const run = store.currentRun;
    if (!run || run.draws === 0) {
      this.statistics = {};
      this.data = null;
      this.list.update({});
      const text = run ? "This run has no draws yet." : "Plots show the draws of a run.";
      fill(this.plots, h("div", { class: "empty" }, text));
      return;
    }
    const summary = await connection.ask<Summary>("summary", { run: run.run });
    if (store.now.run !== run.run) return;
    this.statistics = summary.quantities;
    this.list.update(summary.quantities);
    const names = this.list.selected().slice(0, MOST_PLOTS);
    this.data =
      names.length === 0
        ? { quantities: [], every: 1 }
        : await connection.ask("quantity", { run: run.run, names });
    this.error.clear();
    this.draw();
  }

  private draw(): void {
    const { data } = this;
    const width = this.plots.clientWidth - 16;
    if (!data || width < 100) return;
    const { quantities } = data;
    const top = this.plots.scrollTop;
    if (quantities.length === 0) {
      fill(this.plots, h("div", { class: "empty" }, "Choose quantities from the list above."));
      return;
    }
    const kind = this.kinds.value;
    const single = SINGLE[kind];
    if (single) {
      const named = (q: Quantity) => {
        const plot = single(q, width, data.every);
        plot.prepend(h("figcaption", {}, h("code", {}, q.name)));
        return plot;
      };
      fill(this.plots, ...quantities.map(named));
    } else if (kind === "pairs") {
      const note = `The first ${MOST_PAIRS} of ${quantities.length} chosen quantities.`;
      const more = quantities.length > MOST_PAIRS ? h("p", { class: "muted" }, note) : null;
      fill(this.plots, pairsPlot(quantities, width), more);
    } else {
      // Log densities are in the hundreds, and would squeeze the choices together.
      const choices = quantities.filter(({ name }) => !/^(log_|lp__)/.test(name));
      const intervals = (choices.length > 0 ? choices : quantities)
        .map(({ name }) => interval(name, this.statistics[name] ?? {}))
        .filter((i): i is Interval => i !== null);
      if (intervals.length > 0) fill(this.plots, forestPlot(intervals, width));
      else fill(this.plots, h("div", { class: "empty" }, "These quantities have no intervals."));
    }
    this.plots.scrollTop = top;
  }
}
