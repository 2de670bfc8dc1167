// The middle of the page: the viewer, and which states it shows.

import type { Actions, View } from "./actions";
import { button, fill, h, Segments, select } from "./dom";
import { ErrorBox } from "./errors";
import type { Chooser } from "./chooser";
import { HintLayer } from "./hint_layer";
import { hasBest, imageItem } from "./protocol";
import { StartPanel } from "./start_panel";
import { LimbLayer } from "./limb_layer";
import { StudioData, statesOf, timelineOf } from "./studio_data";
import { Viewer } from "./viewer";

const VIEWS: [View, string][] = [
  ["session", "Session"],
  ["best", "Best"],
  ["draws", "Draws"],
  ["film", "Film"],
  ["modes", "Modes"],
];

const KINDS: [string, string][] = [
  ["", "Export"],
  ["film.png", "Film as PNG"],
  ["film.glb", "Film as glTF"],
  ["report.html", "Report"],
];

const TITLES: Record<View, string> = {
  session: "The session's state, which you can change",
  best: "The best state of the run so far",
  draws: "The kept draws of the run",
  film: "From the prior to the posterior",
  modes: "The best state of each mode, after the run",
};

/** Feeds the viewer with the states that the user chose. */
export class ScenePanel {
  readonly element: HTMLElement;
  private readonly views: Segments;
  private readonly viewer: Viewer;
  private readonly error = new ErrorBox();
  private readonly note = h("div", { class: "note-bar", role: "note", hidden: true });
  private readonly start: StartPanel;
  private readonly exports: HTMLElement;
  private shown = "";
  private key = "";

  constructor(
    private readonly actions: Actions,
    private readonly chooser: Chooser,
  ) {
    const { store } = actions;
    this.start = new StartPanel(chooser);
    const choose = (view: string) => store.set({ view: view as View, at: null });
    this.views = new Segments("States", VIEWS, "session", choose);
    for (const child of this.views.element.children) {
      const view = (child as HTMLElement).dataset.value as View;
      (child as HTMLElement).title = TITLES[view];
    }
    const edit = button("Edit", () => this.edit(), {
      title: "Open a session at the run's best state",
    });
    const exports = select(KINDS, "", (kind) => {
      exports.value = "";
      this.download(kind);
    }, { "aria-label": "Make and download", title: "Make and download a film or report" });
    this.exports = h("div", { class: "exports" }, edit, exports);
    this.viewer = new Viewer(this.views.element);
    this.viewer.onFrame = (at) => store.set({ view: timelineOf(store.now) ?? store.now.view, at });
    const hints = new HintLayer(actions, this.viewer.pictures);
    const limbs = new LimbLayer(actions, this.viewer.pictures);
    hints.onTool = () => limbs.show(false);
    limbs.onShow = () => hints.putDown();
    // Keys that nothing else has the focus for go along the timeline.
    document.body.addEventListener("keydown", (event) => {
      if (event.target === document.body) this.viewer.key(event);
    });
    this.element = h(
      "div",
      { class: "scene" },
      this.start.element,
      this.note,
      this.viewer.element,
      this.error.element,
    );
    this.viewer.element.querySelector(".viewer-head")!.append(this.exports);
    store.on(["session", "wanting", "run", "photo", "folder"], () => this.showStart());
    const keys = ["session", "photo", "runs", "run", "draws", "modes", "view", "at", "connected"] as const;
    store.on([...keys], () => this.show());
    store.on(["moved"], () => this.follow());
    this.show();
  }

  /** A dragged choice was changed: coarse pictures follow it. */
  private follow(): void {
    const { view, moved } = this.actions.store.now;
    if (view === "session") this.viewer.refresh(moved.coarse);
  }

  private show(): void {
    const { store, connection } = this.actions;
    const known = store.now;
    const run = store.currentRun;
    this.views.value = known.view;
    this.views.enable("session", known.session !== null);
    this.views.enable("best", hasBest(run));
    this.views.enable("draws", (known.draws?.draws.length ?? run?.draws ?? 0) > 0);
    this.views.enable("film", (known.draws?.film.length ?? run?.film ?? 0) > 0);
    this.views.enable("modes", known.modes > 0);
    this.exports.hidden = run === null;
    for (const child of this.exports.children) {
      (child as HTMLButtonElement | HTMLSelectElement).disabled = !hasBest(run);
    }
    this.showStart();
    this.showNote();
    if (!known.connected) return;
    const led = timelineOf(known);
    const others = led ? statesOf({ ...known, view: led }).map(([frame]) => frame) : [];
    this.viewer.setOthers(others);
    const data = new StudioData(connection, known);
    // Pictures are asked for again only when the state changed, not whenever anything is known.
    const revision = known.view === "session" ? known.session?.revision : run?.revision;
    const moving = known.view === "session" || known.view === "best";
    const shown = JSON.stringify([
      data.key,
      moving ? revision : data.frames.length,
      data.frames.length,
      // Ghosts are a sample of the draws: twice as many make another sample worth its price.
      Math.floor(Math.log2(data.drawCount + 1)),
    ]);
    if (shown === this.shown) {
      if (known.at !== null && known.at !== this.viewer.current) this.viewer.setFrame(known.at);
      return;
    }
    const same = data.key === this.key;
    this.key = data.key;
    this.shown = shown;
    // While a choice is dragged its own answers bring the pictures.
    if (known.dragging && moving && same) return;
    this.viewer.setData(data, known.at ?? 0);
  }

  /** Without a program or a run there is nothing to view: the first page is in its place. */
  private showStart(): void {
    const { session, run } = this.actions.store.now;
    const isFirst = session === null && run === null;
    this.start.element.hidden = !isFirst;
    this.viewer.element.hidden = isFirst;
    if (isFirst) this.start.show();
  }

  private showNote(): void {
    const { session, view, photo } = this.actions.store.now;
    const missing = (session?.data ?? []).filter((d) => !d.given);
    const notes = view === "session" && session ? this.notes(session.note, missing.length > 0) : [];
    const image = session && imageItem(session.data);
    if (session && !image && photo !== null && session.has_view) {
      notes.push(h("span", {}, `${session.program} takes no photograph: ${photo} is not used.`));
    }
    if (notes.length > 0 && image && missing.includes(image)) {
      const buttons = this.chooser.photoButtons();
      notes.push(h("span", {}, "It needs a photograph:"), h("div", { class: "buttons" }, ...buttons));
    } else if (notes.length > 0 && missing.length > 0) {
      const names = missing.map((d) => d.name).join(", ");
      notes.push(h("span", {}, `Say in the program where \`${names}\` is: data d = csv("FILE");`));
    }
    fill(this.note, ...notes);
    this.note.hidden = notes.length === 0;
    const none = "This program draws no scene: its choices are under Trace, its draws under Plots.";
    const run = this.actions.store.currentRun;
    const early = run?.state === "failed" ? "The run failed." : "The run has no state yet.";
    if (view === "best" && !hasBest(run)) this.viewer.setEmpty(early);
    else this.viewer.setEmpty(session && !session.has_view ? none : "No picture yet");
  }

  /** What is to be known of the session's state. */
  private notes(note: string | null, lacks: boolean): HTMLElement[] {
    const { session, runs } = this.actions.store.now;
    // The log joint is shown elsewhere; what is missing is asked for.
    const isSaid = (line: string) => /^log joint|is not given, so nothing is observed/.test(line);
    const lines = (note ?? "").split("\n").filter((line) => line.trim() && !isSaid(line));
    const notes = lines.map((line) => h("span", { class: "warned" }, line.replace(/^note: /, "")));
    const isFirst = session?.is_prior && !runs.some((r) => r.session === session.session);
    if (lacks) notes.push(h("b", {}, "A draw from the prior."));
    else if (isFirst) notes.push(h("b", {}, "A draw from the prior: press Start to fit it."));
    return notes;
  }

  private edit(): void {
    const run = this.actions.store.now.run;
    if (run !== null) void this.error.guard(() => this.actions.openRun(run));
  }

  private download(kind: string): void {
    const run = this.actions.store.now.run;
    if (run !== null) void this.error.guard(() => this.actions.download(run, kind));
  }
}
