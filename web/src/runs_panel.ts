// The tab Runs: all runs of the folder, and what can be done with each.

import type { Actions } from "./actions";
import { button, duration, fill, h, number } from "./dom";
import { Panel } from "./panel";
import { canGoOn, hasBest, isLive, runName, type Run, type Summary } from "./protocol";

/** A table of runs; below it what the chosen one left. */
export class RunsPanel extends Panel {
  readonly element: HTMLElement;
  private readonly body = h("tbody");
  private readonly about = h("div", { class: "run-about" });

  constructor(actions: Actions) {
    super(actions, ["runs", "run"]);
    const head = ["Run", "State", "Best", "R-hat", "Draws", "Time", ""];
    const numbers = new Set(["Best", "R-hat", "Draws", "Time"]);
    const titles = head.map((t) => h("th", { class: numbers.has(t) ? "number" : null }, t));
    this.element = h(
      "div",
      { class: "panel" },
      this.error.element,
      h(
        "div",
        { class: "scroll" },
        h("table", {}, h("thead", {}, h("tr", {}, ...titles)), this.body),
        this.about,
      ),
    );
  }

  protected show(): void {
    const { runs } = this.actions.store.now;
    if (runs.length === 0) {
      const text = "No runs yet: Start makes one.";
      fill(this.body, h("tr", {}, h("td", { colspan: 7, class: "muted" }, text)));
      fill(this.about);
      return;
    }
    // Under the pointer buttons must stay: rows are replaced only when their text changed.
    const rows = [...runs].reverse().map((run) => this.row(run));
    const old = [...this.body.children];
    if (old.length !== rows.length) fill(this.body, ...rows);
    else old.forEach((o, i) => o.outerHTML !== rows[i]!.outerHTML && o.replaceWith(rows[i]!));
    const run = this.actions.store.currentRun;
    if (!this.isNew(run ? `${run.run} ${run.state} ${hasBest(run)}` : "")) return;
    fill(this.about);
    if (run) this.reads.call();
  }

  private row(run: Run): HTMLElement {
    const { actions } = this;
    const guard = (task: () => Promise<unknown>) => () => void this.error.guard(task);
    const name = button(runName(run.run), () => actions.choose(run.run), { class: "link" });
    name.title = `${run.program}, ${run.observe.join(", ") || "no data"}\n${run.folder}`;
    const buttons: HTMLElement[] = [];
    if (run.state === "running") {
      buttons.push(button("Pause", guard(() => actions.steer("pause", run.run))));
    }
    if (canGoOn(run)) buttons.push(button("Go on", guard(() => actions.steer("go_on", run.run))));
    if (isLive(run)) buttons.push(button("Stop", guard(() => actions.steer("stop", run.run))));
    else {
      const title = "Take it off this list; its folder stays";
      const label = `Remove ${runName(run.run)} from this list`;
      const attributes = { title, class: "quiet", "aria-label": label };
      buttons.push(button("×", guard(() => actions.remove(run.run)), attributes));
    }
    const current = run.run === actions.store.now.run;
    return h(
      "tr",
      { "aria-current": current ? "true" : null },
      h("td", {}, name, run.error ? h("pre", { class: "failed" }, run.error) : null),
      h("td", {}, h("span", { class: `state ${run.state}` }, run.state)),
      h("td", { class: "number" }, number(run.best)),
      h("td", { class: "number" }, number(run.r_hat, 3)),
      h("td", { class: "number" }, String(run.draws)),
      h("td", { class: "number" }, duration(run.elapsed)),
      h("td", {}, h("div", { class: "buttons" }, ...buttons)),
    );
  }

  protected async read(): Promise<void> {
    const { connection, store } = this.actions;
    const run = store.currentRun;
    if (!run || run.state === "waiting" || !hasBest(run)) return;
    const summary = await connection.ask<Summary>("summary", { run: run.run });
    if (store.now.run !== run.run) return;
    this.error.clear();
    const list = (title: string, texts: string[], kind = "") =>
      texts.length === 0
        ? null
        : h("div", {}, h("h3", {}, title), h("ul", { class: kind }, ...texts.map(item)));
    const files = summary.files.map((file) => this.fileLink(run, file));
    fill(
      this.about,
      h("h2", {}, runName(run.run)),
      summary.command ? h("pre", { class: "answer" }, summary.command) : null,
      list("Warnings", summary.warnings, "warnings"),
      list("Approximations", summary.approximate),
      files.length > 0 ? h("div", {}, h("h3", {}, "Files"), h("p", {}, ...files)) : null,
    );
  }

  private fileLink(run: Run, file: string): HTMLElement {
    const href = this.actions.connection.fileAddress(`${run.folder}/${file}`);
    return h("a", { href, target: "_blank", rel: "noreferrer", class: "file" }, file);
  }
}

function item(text: string): HTMLElement {
  return h("li", {}, text);
}
