// The bar at the top: what is open, and the controls of the run.

import type { Actions } from "./actions";
import { button, duration, fill, h, number, select, setOptions } from "./dom";
import { ErrorBox } from "./errors";
import { helpButton } from "./help";
import { canGoOn, isLive, runName, type Run } from "./protocol";
import { SettingsForm } from "./settings";

const OTHER = "…";

/** The program, its photograph, and Start, Pause, Go on, Stop. */
export class TopBar {
  readonly element: HTMLElement;
  readonly error = new ErrorBox();
  /** Why the run that is looked at failed. */
  readonly runError = new ErrorBox();
  private failed = "";
  private readonly program = select([], "", (file) => this.openProgram(file), {
    "aria-label": "Program",
    class: "strong",
  });
  private readonly photo = select([], "", (file) => this.openPhoto(file), {
    "aria-label": "Photograph",
  });
  private readonly upload = h("input", { type: "file", accept: "image/png,image/jpeg" });
  private readonly start = button("Start", () => this.begin(), { class: "primary" });
  private readonly pause = button("Pause", () => this.steer("pause"));
  private readonly goOn = button("Go on", () => this.steer("go_on"));
  private readonly stop = button("Stop", () => this.steer("stop"));
  private readonly gear = button("Settings", () => this.settings.open());
  private readonly settings = new SettingsForm(this.gear);
  private readonly status = h("div", { class: "status" });
  private readonly found = h("p", { class: "found", hidden: true });
  private readonly bar = h("progress", { max: 1, "aria-label": "Progress of the phase" });

  constructor(private readonly actions: Actions) {
    const { store } = actions;
    this.upload.hidden = true;
    this.upload.addEventListener("change", () => {
      const file = this.upload.files?.[0];
      if (file) void this.error.guard(() => this.take(file));
      this.upload.value = "";
    });
    this.start.title = "Start inference (Alt-R)";
    const wrap = h("div", { class: "settings-wrap" }, this.gear, this.settings.element);
    this.element = h(
      "header",
      { class: "top-bar" },
      h("span", { class: "brand" }, "pcadlang"),
      h("div", { class: "group" }, this.program, this.photo, this.upload),
      h("div", { class: "group" }, this.start, this.pause, this.goOn, this.stop, wrap),
      h("div", { class: "progress" }, this.status, this.bar),
      helpButton(),
      this.found,
    );
    document.addEventListener("keydown", (event) => {
      if (event.altKey && event.code === "KeyR") {
        event.preventDefault();
        this.begin();
      }
    });
    store.on(["session", "folder"], () => this.showSession());
    store.on(["runs", "run"], () => this.showRun());
    this.showSession();
    this.showRun();
  }

  /** Stores a photograph that was chosen or dropped, and observes it. */
  async take(file: File): Promise<void> {
    if (!/^image\/(png|jpeg)$/.test(file.type)) {
      throw new Error(`${file.name} is no PNG or JPEG picture`);
    }
    await this.actions.observePicture(await this.actions.connection.upload(file));
  }

  private begin(): void {
    void this.error.guard(async () => this.actions.run(this.settings.settings()));
  }

  private steer(method: "pause" | "go_on" | "stop"): void {
    const run = this.actions.store.now.run;
    if (run !== null) void this.error.guard(() => this.actions.steer(method, run));
  }

  private openProgram(file: string): void {
    const session = this.actions.store.now.session;
    // The photograph is kept where the new program can take one.
    const observe = session?.photo ? session.observe.filter((o) => !o.includes("=")) : [];
    void this.error.guard(() =>
      this.actions.openProgram(file, observe).catch((error) => {
        if (observe.length === 0) throw error;
        return this.actions.openProgram(file);
      }),
    );
    this.showSession();
  }

  private openPhoto(file: string): void {
    if (file === OTHER) this.upload.click();
    else if (file) void this.error.guard(() => this.actions.observePicture(file));
    this.showSession();
  }

  private showSession(): void {
    const { session, folder } = this.actions.store.now;
    const files = (folder?.programs ?? []).map(({ file, shipped }): [string, string] => {
      return [file, shipped ? `${file} (shipped)` : file];
    });
    const current = session?.program ?? "";
    if (!files.some(([file]) => file === current)) files.unshift([current, current || "Program"]);
    setOptions(this.program, files, current);
    const photo = session?.photo?.name ?? "";
    const given = session?.observe.find((o) => !o.includes("=")) ?? photo;
    const pictures = [...(folder?.pictures ?? [])];
    if (given && !pictures.includes(given)) pictures.unshift(given);
    const options = pictures.map((p): [string, string] => [p, p]);
    if (!given) options.unshift(["", "No photograph"]);
    setOptions(this.photo, [...options, [OTHER, "Another file …"]], given);
    this.settings.setSession(session);
    this.start.disabled = session === null;
    document.title = session ? `${session.program} – pcadlang studio` : "pcadlang studio";
  }

  private showRun(): void {
    const run = this.actions.store.currentRun;
    this.pause.hidden = run?.state !== "running" && run?.state !== "waiting";
    this.goOn.hidden = !run || !canGoOn(run);
    this.stop.hidden = !run || !isLive(run);
    this.stop.disabled = run?.state === "stopping";
    this.bar.hidden = !run || !isLive(run);
    if (run && run.done !== null && run.done !== undefined) this.bar.value = run.done;
    else this.bar.removeAttribute("value");
    fill(this.status, ...(run ? statusOf(run) : ["No run yet"]));
    this.found.textContent = run?.found ?? "";
    this.found.hidden = !run?.found;
    const failed = run?.error ? `${run.run} ${run.error}` : "";
    if (failed === this.failed) return;
    this.failed = failed;
    if (run?.error) this.runError.show(new Error(run.error));
    else this.runError.clear();
  }
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
