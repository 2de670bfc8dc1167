// The bar at the top: what is open, and the controls of the run.

import type { Actions } from "./actions";
import { Chooser } from "./chooser";
import { Refusal } from "./connection";
import { button, duration, fill, h, number, select, setOptions } from "./dom";
import { ErrorBox } from "./errors";
import { helpButton } from "./help";
import { canGoOn, isLive, runName, type Run } from "./protocol";
import { SettingsForm } from "./settings";

// Not names of files: these have an ending.
const OTHER = "…";
const NEW = "new";
const EXAMPLE = "example ";

/** The program, its photograph, and Start, Pause, Go on, Stop. */
export class TopBar {
  readonly element: HTMLElement;
  readonly error = new ErrorBox();
  /** Why the run that is looked at failed. */
  readonly runError = new ErrorBox();
  private failed = "";
  readonly chooser: Chooser;
  /** Applies what is in the editor before a run. */
  onStart: () => Promise<void> = async () => {};
  private readonly program = select([], "", (file) => this.openProgram(file), {
    "aria-label": "Program",
    class: "strong",
  });
  private readonly photo = select([], "", (file) => this.openPhoto(file), {
    "aria-label": "Photograph",
  });
  private readonly start = button("Start", () => this.begin(), { class: "primary" });
  private readonly pause = button("Pause", () => this.steer("pause"));
  private readonly goOn = button("Go on", () => this.steer("go_on"));
  private readonly stop = button("Stop", () => this.steer("stop"));
  private readonly gear = button("Settings", () => this.settings.open());
  private readonly settings = new SettingsForm(this.gear);
  private readonly status = h("div", { class: "status" });
  private readonly found = h("div", { class: "found", role: "status", hidden: true });
  private readonly bar = h("progress", { max: 1, "aria-label": "Progress of the phase" });

  constructor(private readonly actions: Actions) {
    const { store } = actions;
    this.chooser = new Chooser(actions, this.error);
    this.start.title = "Start inference (Alt-R)";
    const wrap = h("div", { class: "settings-wrap" }, this.gear, this.settings.element);
    this.element = h(
      "header",
      { class: "top-bar" },
      h("span", { class: "brand" }, "pcadlang"),
      h("div", { class: "group" }, this.program, this.photo, this.chooser.element),
      h("div", { class: "group" }, this.start, this.settings.quality, this.pause, this.goOn, this.stop, wrap, helpButton()),
      h("div", { class: "progress" }, this.status, this.bar),
      this.found,
    );
    document.addEventListener("keydown", (event) => {
      if (event.altKey && event.code === "KeyR") {
        event.preventDefault();
        this.begin();
      }
    });
    store.on(["session", "wanting", "photo", "folder"], () => this.showSession());
    store.on(["runs", "run", "session", "warnings"], () => this.showRun());
    this.showSession();
    this.showRun();
  }

  private begin(): void {
    void this.error.guard(async () => {
      await this.onStart();
      await this.actions.run(this.settings.settings());
    });
  }

  private steer(method: "pause" | "go_on" | "stop"): void {
    const run = this.actions.store.now.run;
    if (run !== null) void this.error.guard(() => this.actions.steer(method, run));
  }

  private openProgram(file: string): void {
    if (file === OTHER) this.chooser.programFile();
    else if (file === NEW) this.chooser.newProgram();
    else if (file) this.chooser.program(file);
    this.showSession();
  }

  private openPhoto(file: string): void {
    if (file === OTHER) this.chooser.pictureFile();
    else if (file.startsWith(EXAMPLE)) this.chooser.example(file.slice(EXAMPLE.length));
    else this.chooser.photo(file === "" ? null : file);
    this.showSession();
  }

  private showSession(): void {
    const { session, wanting, folder, photo } = this.actions.store.now;
    const files = (folder?.programs ?? []).map(({ file, shipped }): [string, string] => {
      return [file, shipped ? `${file} (shipped)` : file];
    });
    const current = session?.program ?? wanting?.program ?? "";
    if (!files.some(([file]) => file === current)) {
      files.unshift([current, current || "Choose a program"]);
    }
    const more: [string, string][] = [[NEW, "New program"], [OTHER, "A program's file …"]];
    setOptions(this.program, [...files, ...more], current);
    const pictures = [...(folder?.pictures ?? [])];
    if (photo !== null && !pictures.includes(photo)) pictures.unshift(photo);
    const options = pictures.map((p): [string, string] => [p, p]);
    const examples = this.chooser.examples().filter((e) => !pictures.includes(`pictures/${e}`));
    setOptions(
      this.photo,
      [
        ["", "No photograph"],
        ...options,
        ...examples.map((e): [string, string] => [`${EXAMPLE}${e}`, `Example: ${e}`]),
        [OTHER, "Another file …"],
      ],
      photo ?? "",
    );
    this.settings.setSession(session);
    document.title = session ? `${session.program} – pcadlang studio` : "pcadlang studio";
  }

  private showRun(): void {
    const { session, runs, warnings } = this.actions.store.now;
    const run = this.actions.store.currentRun;
    const observe = JSON.stringify(session?.observe);
    const isOfSession = (r: Run) => {
      return r.session === session?.session && JSON.stringify(r.observe) === observe;
    };
    const tried = runs.filter(isOfSession);
    this.settings.setTried(tried.length > 0);
    this.pause.hidden = run?.state !== "running" && run?.state !== "waiting";
    this.goOn.hidden = !run || !canGoOn(run);
    this.stop.hidden = !run || !isLive(run);
    this.stop.disabled = run?.state === "stopping";
    this.bar.hidden = !run || !isLive(run);
    if (run && run.done !== null && run.done !== undefined) this.bar.value = run.done;
    else this.bar.removeAttribute("value");
    fill(this.status, ...(run ? statusOf(run) : ["No run yet"]));
    fill(
      this.found,
      run?.found ? verdict(run.found, tried.length === 1 && tried[0] === run) : null,
      warnings.length > 0 ? warningList(warnings) : null,
    );
    this.found.hidden = this.found.childElementCount === 0;
    const failed = run?.error ? `${run.run} ${run.error}` : "";
    if (failed === this.failed) return;
    this.failed = failed;
    if (run?.error) this.runError.show(failure(run.error));
    else this.runError.clear();
  }
}

/** Whether the object was found; of options of the command line the page has its own. */
function verdict(found: string, isFirst: boolean): HTMLElement {
  const text = found.replace(/ \([^()]*--[^()]*\)/g, "");
  const isFound = /^found/i.test(text);
  const kind = isFound ? "is-found" : /^perhaps/i.test(text) ? "perhaps" : "not-found";
  const more = isFirst ? "Start again for more time, or point" : "Point";
  const help = isFound ? "" : `. ${more} it out with the tools over the photograph.`;
  return h("p", { class: kind }, text.replace(/\.$/, help ? "" : "."), help);
}

/** Why a run failed; a time that is too short is no fault of the program. */
function failure(error: string): Error {
  if (!/stopped in the middle of an evaluation/.test(error)) return new Error(error);
  const hint = "Start again with the preset `accurate`, or give it a time under Settings";
  return new Refusal("The run ended before it had a first state: it needs more time", hint);
}

/** The warnings of a run; they unfold. */
function warningList(warnings: string[]): HTMLElement {
  const title = warnings.length === 1 ? "1 warning" : `${warnings.length} warnings`;
  const items = warnings.map((text) => h("li", {}, text));
  return h("details", { class: "warnings" }, h("summary", {}, title), h("ul", {}, ...items));
}

/** The state of a run in one line. */
function statusOf(run: Run): (HTMLElement | string)[] {
  const state = run.state === "running" ? (run.phase ?? "running") : run.state;
  const times = [duration(run.elapsed)];
  if (run.left !== null && run.state === "running") times.push(`${duration(run.left)} left`);
  const rest = [times.join(", ")];
  if (run.best !== null) rest.push(`best log joint ${number(run.best, 5)}`);
  if (run.r_hat !== null) rest.push(`R-hat ${number(run.r_hat, 3)}`);
  return [
    h("b", { title: run.folder }, runName(run.run)),
    h("span", { class: `state ${run.state}` }, state),
    h("span", { class: "numbers" }, rest.join(" · ")),
  ];
}
