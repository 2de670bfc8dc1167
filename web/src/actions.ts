// The state of the page, with the listeners to its changes, and the requests of the user, each as
// one method; results go into the state. Panels read from here and never from each other.

import { Latest, type Connection } from "./connection";
import type { Place } from "./fragment";
import type * as P from "./protocol";
import { isLive } from "./protocol";

/** The states that the viewer shows. */
export type View = "session" | "best" | "draws" | "film" | "modes";

export interface Known {
  connected: boolean;
  folder: P.Folder | null;
  session: P.Session | null;
  /** All runs of the folder, newest last. */
  runs: P.Run[];
  /** The run that is looked at. */
  run: string | null;
  /** The kept draws of that run, so far. */
  draws: P.Draws | null;
  /** How many modes that run has; 0 until it ended. */
  modes: number;
  view: View;
  /** The place of the slider in `view`; null: its end. */
  at: number | null;
  tab: string;
  /** A choice is being dragged: pictures may be coarse. */
  dragging: boolean;
  /** The last answered change of a dragged choice: coarse pictures follow it while it goes on. */
  moved: { coarse: boolean };
}

type Listener = () => void;

interface Hinted {
  session: number;
  hint: P.Hint;
  refused: (error: unknown) => void;
}

/** Holds what is known; listeners are called once per turn, after all changes of that turn. */
export class Store {
  private known: Known = {
    connected: false,
    folder: null,
    session: null,
    runs: [],
    run: null,
    draws: null,
    modes: 0,
    view: "session",
    at: null,
    tab: "trace",
    dragging: false,
    moved: { coarse: false },
  };
  private listeners: { keys: (keyof Known)[]; listener: Listener }[] = [];
  private changed = new Set<keyof Known>();

  get now(): Readonly<Known> {
    return this.known;
  }

  /** Calls the listener after any of the keys changed. */
  on(keys: (keyof Known)[], listener: Listener): void {
    this.listeners.push({ keys, listener });
  }

  /** Changes what is known. */
  set(patch: Partial<Known>): void {
    for (const key of Object.keys(patch) as (keyof Known)[]) {
      if (patch[key] === this.known[key]) continue;
      if (this.changed.size === 0) queueMicrotask(() => this.tell());
      this.changed.add(key);
    }
    Object.assign(this.known, patch);
  }

  /** The run that is looked at. */
  get currentRun(): P.Run | null {
    return this.known.runs.find((r) => r.run === this.known.run) ?? null;
  }

  private tell(): void {
    const changed = this.changed;
    this.changed = new Set();
    for (const { keys, listener } of this.listeners) {
      if (keys.some((key) => changed.has(key))) listener();
    }
  }
}

const VIEWS: View[] = ["session", "best", "draws", "film", "modes"];

/** The page's dealings with the program. */
export class Actions {
  /** Shows an error that belongs to no panel. */
  onError: (error: unknown) => void = () => {};
  /** Replaces the editor's text by a session's that was just opened. */
  onOpened: (session: P.Session) => void = () => {};

  private readonly folder = new Latest<void>(() => this.readFolder(), (e) => this.onError(e));
  private readonly session = new Latest<void>(() => this.readSession(), (e) => this.onError(e));
  private readonly draws = new Latest<void>(() => this.readDraws(), (e) => this.onError(e));
  private readonly hints = new Latest<Hinted>((asked) => this.sendHint(asked));
  /** The last session that this page opened. */
  private opened: number | null = null;
  private drawsTimer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    readonly connection: Connection,
    readonly store: Store,
  ) {
    connection.onEvent = (event) => this.take(event);
  }

  /** Reads everything that is shown: at the start, and after the connection was lost. */
  async load(place: Place): Promise<void> {
    await this.readFolder();
    const { folder, runs } = this.store.now;
    const wanted = this.store.now.session?.session ?? place.session;
    const sessions = folder?.sessions ?? [];
    const id = wanted !== null && sessions.includes(wanted) ? wanted : sessions[0];
    if (id !== undefined) {
      const session = await this.connection.ask<P.Session>("session", { session: id });
      this.store.set({ session });
      this.onOpened(session);
    } else {
      this.store.set({ session: null });
    }
    const run = runs.find((r) => r.run === place.run) ?? runs.find((r) => r.session === id);
    const view = VIEWS.find((v) => v === place.view) ?? (run ? "best" : "session");
    this.store.set({ run: run?.run ?? null, view: run ? view : "session", at: place.at });
    await Promise.all([this.readDraws(), this.readModes()]);
  }

  /** Opens a session of a program file. */
  async openProgram(program: string, observe: string[] = []): Promise<void> {
    await this.hints.rest;
    const before = this.store.now.session;
    let session = await this.connection.ask<P.Session>("open", { program, observe });
    // The same photograph keeps its hint.
    if (session.photo && JSON.stringify(before?.observe) === JSON.stringify(observe)) {
      const params = { session: session.session, hint: before!.hint };
      session = await this.connection.ask<P.Session>("hint", params);
    }
    await this.closeLast(session.session);
    this.store.set({ session, view: "session", run: null, draws: null, modes: 0, at: null });
    this.onOpened(session);
    await this.readFolder();
  }

  /** Opens a session at the best state of a run. */
  async openRun(run: string): Promise<void> {
    // The run stays in view: its draws are the ghosts behind what is edited.
    const session = await this.connection.ask<P.Session>("open", { run });
    await this.closeLast(session.session);
    this.store.set({ session, view: "session" });
    this.onOpened(session);
    await this.readFolder();
  }

  /** Gives the session other data; without a session nothing can take them. */
  async observe(observe: string[]): Promise<void> {
    const session = this.store.now.session;
    if (!session) throw new Error("open a program first: a photograph is observed by one");
    await this.hints.rest;
    const params = { session: session.session, observe };
    this.store.set({ session: await this.connection.ask("observe", params), view: "session" });
  }

  /** Says where the object is in the session's photograph; of several hints the last one counts. */
  hint(hint: P.Hint, refused: (error: unknown) => void): void {
    const session = this.store.now.session?.session;
    if (session !== undefined) this.hints.call({ session, hint, refused });
  }

  private async sendHint({ session, hint, refused }: Hinted): Promise<void> {
    try {
      const next = await this.connection.ask<P.Session>("hint", { session, hint });
      if (this.store.now.session?.session === session) this.store.set({ session: next });
    } catch (error) {
      if (!this.hints.waiting) refused(error);
    }
  }

  /** True until the session has the last hint. */
  get isHinting(): boolean {
    return this.hints.busy;
  }

  /** Gives the session a photograph; its other data stay. */
  async observePicture(file: string): Promise<void> {
    const others = (this.store.now.session?.observe ?? []).filter((o) => o.includes("="));
    await this.observe([file, ...others]);
  }

  /** Replaces the session's program; shared choices keep their values. */
  async replace(text: string): Promise<P.Session | null> {
    const session = this.store.now.session;
    if (!session) return null;
    const params = { session: session.session, text };
    const next = await this.connection.ask<P.Session>("replace", params);
    this.store.set({ session: next });
    return next;
  }

  /** Says a line at the session's prompt. */
  async enter(text: string): Promise<P.Reply> {
    const session = this.store.now.session;
    if (!session) throw new Error("no program is open");
    return this.connection.ask<P.Reply>("enter", { session: session.session, text });
  }

  /** Starts a run of the session's program. */
  async run(settings: P.Settings): Promise<void> {
    await this.hints.rest;
    const session = this.store.now.session;
    if (!session) return;
    const run = await this.connection.ask<P.Run>("run", { session: session.session, settings });
    this.keep(run);
    this.choose(run.run, "best");
  }

  /** Pauses, goes on with, or stops a run. */
  async steer(method: "pause" | "go_on" | "stop", run: string): Promise<void> {
    this.keep(await this.connection.ask<P.Run>(method, { run }));
  }

  /** Forgets a run that ended; its folder stays. */
  async remove(run: string): Promise<void> {
    await this.connection.ask("remove", { run });
    if (this.store.now.run === run) this.store.set({ run: null, view: "session", draws: null });
    await this.readFolder();
  }

  /** Looks at another run. */
  choose(run: string, view: View = "best"): void {
    if (this.store.now.run === run) {
      this.store.set({ view });
      return;
    }
    this.store.set({ run, view, at: null, draws: null, modes: 0 });
    this.draws.call();
    this.readModes().catch((e) => this.onError(e));
  }

  /** Writes a film or report of a run and downloads it. */
  async download(run: string, kind: string): Promise<void> {
    const { file } = await this.connection.ask<{ file: string }>("export", { run, kind });
    const link = document.createElement("a");
    link.href = this.connection.fileAddress(file);
    link.download = `${run.split("/").pop()}-${kind}`;
    link.click();
  }

  /** Reads the session again: its text and history, after a change. */
  refreshSession(): void {
    this.session.call();
  }

  /** Closes the session that this page opened before: their number is limited. Those that
   * other pages opened, or that runs still work for, stay. */
  private async closeLast(next: number): Promise<void> {
    const last = this.opened;
    this.opened = next;
    const works = this.store.now.runs.some((run) => run.session === last && isLive(run));
    if (last === null || works) return;
    await this.connection.ask("close", { session: last });
  }

  private take(event: P.Event): void {
    if (event.event === "folder") this.folder.call();
    else if (event.event === "run") this.keep(event.run);
    else {
      const { session, dragging } = this.store.now;
      if (session?.session !== event.session) return;
      if (event.revision <= session.revision) return;
      this.store.set({ session: { ...session, revision: event.revision } });
      if (!dragging) this.session.call();
    }
  }

  private keep(run: P.Run): void {
    const { runs, run: current } = this.store.now;
    const before = runs.find((r) => r.run === run.run);
    this.store.set({
      runs: before ? runs.map((r) => (r === before ? run : r)) : [...runs, run],
    });
    if (run.run !== current) return;
    if (before && isLive(before) && !isLive(run)) {
      this.readModes().catch((e) => this.onError(e));
      this.draws.call();
    } else if (before?.draws !== run.draws || before?.film !== run.film) {
      // Draws come many times a second; the list of them is read once a second.
      this.drawsTimer ??= setTimeout(() => {
        this.drawsTimer = null;
        this.draws.call();
      }, 1000);
    }
  }

  private async readFolder(): Promise<void> {
    const folder = await this.connection.ask<P.Folder>("folder");
    this.store.set({ folder, runs: folder.runs });
  }

  private async readSession(): Promise<void> {
    const id = this.store.now.session?.session;
    if (id === undefined) return;
    const session = await this.connection.ask<P.Session>("session", { session: id });
    const now = this.store.now.session;
    if (now?.session === id && session.revision >= now.revision) this.store.set({ session });
  }

  private async readDraws(): Promise<void> {
    const { run } = this.store.now;
    const current = this.store.currentRun;
    if (run === null || !current) return;
    // A run that just began, or failed before it did, has nothing to list.
    const begun = current.draws > 0 || Boolean(current.film);
    if (!begun && (isLive(current) || current.state === "failed")) return;
    const draws = await this.connection.ask<P.Draws>("draws", { run });
    if (this.store.now.run === run) this.store.set({ draws });
  }

  private async readModes(): Promise<void> {
    const run = this.store.currentRun;
    if (!run || isLive(run) || run.state === "failed") return;
    const summary = await this.connection.ask<P.Summary>("summary", { run: run.run });
    if (this.store.now.run === run.run) this.store.set({ modes: summary.modes.length });
  }
}
