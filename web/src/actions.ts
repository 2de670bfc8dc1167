// The state of the page, with the listeners to its changes, and the requests of the user, each as
// one method; results go into the state. Panels read from here and never from each other.

import { Latest, Refusal, type Connection } from "./connection";
import type { Place } from "./fragment";
import type * as P from "./protocol";
import { isEmpty } from "./pointing";
import { imageItem, isLive, runName } from "./protocol";

/** The states that the viewer shows. */
export type View = "session" | "best" | "draws" | "film" | "modes";

export interface Known {
  connected: boolean;
  folder: P.Folder | null;
  session: P.Session | null;
  /** The chosen program, while it cannot be opened without its data. */
  wanting: P.Wanting | null;
  /** The photograph at hand, a file of the folder, whether or not a program takes it. */
  photo: string | null;
  /** All runs of the folder, newest last. */
  runs: P.Run[];
  /** The run that is looked at. */
  run: string | null;
  /** The kept draws of that run, so far. */
  draws: P.Draws | null;
  /** How many modes that run has; 0 until it ended. */
  modes: number;
  /** What that run warns of, once it has ended. */
  warnings: string[];
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
    wanting: null,
    photo: null,
    runs: [],
    run: null,
    draws: null,
    modes: 0,
    warnings: [],
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

const PHOTO_HINT = "drop one on the page, or choose one at the top: the example, or a file";

/** No run is looked at: nothing of the one before stays in sight. */
const NO_RUN: Pick<Known, "run" | "draws" | "modes" | "warnings" | "at" | "view"> = {
  run: null,
  draws: null,
  modes: 0,
  warnings: [],
  at: null,
  view: "session",
};

const VIEWS: View[] = ["session", "best", "draws", "film", "modes"];

/** The page's dealings with the program. */
export class Actions {
  /** Shows an error that belongs to no panel. */
  onError: (error: unknown) => void = () => {};
  /** Replaces the editor's text by a session's that was just opened. */
  onOpened: (session: P.Session | P.Wanting) => void = () => {};
  /** Says what another tab did, with what can be done about it. */
  onTold: (text: string, act?: { name: string; task: () => Promise<void> }) => void = () => {};

  private readonly folder = new Latest<void>(() => this.readFolder(), (e) => this.onError(e));
  private readonly session = new Latest<void>(() => this.readSession(), (e) => this.onError(e));
  private readonly draws = new Latest<void>(() => this.readDraws(), (e) => this.onError(e));
  private readonly hints = new Latest<Hinted>((asked) => this.sendHint(asked));
  /** The last session that this page opened. */
  private opened: number | null = null;
  /** What this page opens or starts itself is no news: its events wait for the answer. */
  private own: Promise<unknown> = Promise.resolve();
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
    const id = wanted !== null && sessions.includes(wanted) ? wanted : sessions[sessions.length - 1];
    if (id !== undefined) {
      await this.showSession(id);
    } else if (this.store.now.session) {
      this.store.set({ session: null, ...NO_RUN });
    }
    const run = runs.find((r) => r.run === place.run) ?? runs.find((r) => r.session === id);
    const view = VIEWS.find((v) => v === place.view) ?? (run ? "best" : "session");
    this.store.set({ run: run?.run ?? null, view: run ? view : "session", at: place.at });
    await Promise.all([this.readDraws(), this.readModes()]);
  }

  /** Opens a session of a program file, with the photograph at hand if it takes one. */
  openProgram(program: string): Promise<void> {
    return this.mine(async () => this.open(program));
  }

  private async open(program: string): Promise<void> {
    await this.hints.rest;
    const { session: before, photo } = this.store.now;
    const params = { program, photo };
    let session = await this.connection.ask<P.Session | P.Wanting>("open", params);
    if (session.session === null) {
      this.store.set({ session: null, wanting: session, ...NO_RUN });
      await this.closeLast(null);
    } else {
      // The same photograph keeps its hint.
      const same = session.photo !== null && session.photo.name === before?.photo?.name;
      if (same && !isEmpty(before.hint)) {
        const params = { session: session.session, hint: before.hint };
        session = await this.connection.ask<P.Session>("hint", params);
      }
      this.store.set({ session, wanting: null, ...NO_RUN });
      await this.closeLast(session.session);
    }
    this.onOpened(session);
    await this.readFolder();
  }

  /** Shows a session that is open. */
  async showSession(id: number): Promise<void> {
    const session = await this.connection.ask<P.Session>("session", { session: id });
    const { session: before, photo } = this.store.now;
    const kept = before?.session === id ? {} : NO_RUN;
    this.store.set({ session, wanting: null, photo: session.photo?.name ?? photo, ...kept });
    this.onOpened(session);
  }

  /** Opens a session at the best state of a run. */
  openRun(run: string): Promise<void> {
    return this.mine(async () => this.edit(run));
  }

  private async edit(run: string): Promise<void> {
    // The run stays in view: its draws are the ghosts behind what is edited.
    const session = await this.connection.ask<P.Session>("open", { run });
    const photo = session.photo?.name ?? this.store.now.photo;
    this.store.set({ session, wanting: null, photo, view: "session" });
    await this.closeLast(session.session);
    this.onOpened(session);
    await this.readFolder();
  }

  /** Takes another photograph, or none; a program that takes one observes it. */
  async choosePhoto(photo: string | null): Promise<void> {
    await this.hints.rest;
    const { session, wanting } = this.store.now;
    const image = imageItem(session?.data ?? []);
    if (session && image) {
      const others = session.observe.filter((o) => {
        return o.includes("=") && !o.startsWith(`${image.name}=`);
      });
      const observe = photo === null ? others : [`${image.name}=${photo}`, ...others];
      const params = { session: session.session, observe };
      const next = await this.connection.ask<P.Session>("observe", params);
      this.store.set({ session: next, photo, ...NO_RUN });
      return;
    }
    this.store.set({ photo });
    if (wanting && photo !== null) await this.openProgram(wanting.program);
  }

  /** Takes a photograph that comes with pcadlang. */
  async chooseExample(picture: string): Promise<void> {
    const { file } = await this.connection.ask<{ file: string }>("example", { picture });
    await this.choosePhoto(file);
  }

  /** Stores a program that was chosen or dropped, beside others of its name, and opens it. */
  async takeProgram(name: string, text: string): Promise<void> {
    const stem = name.replace(/\.pcad$/, "");
    const own = (this.store.now.folder?.programs ?? []).filter((p) => !p.shipped);
    for (let n = 1; ; n++) {
      const file = n === 1 ? `${stem}.pcad` : `${stem}-${n}.pcad`;
      const exists = own.some((p) => p.file === file);
      const there = exists
        ? (await this.connection.ask<{ text: string }>("read", { file })).text
        : null;
      if (there !== null && there !== text) continue;
      if (there === null) await this.connection.ask("write", { file, text });
      return this.openProgram(file);
    }
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

  /** Replaces the session's program; shared choices keep their values. */
  async replace(text: string): Promise<P.Session | null> {
    const { session, photo } = this.store.now;
    if (!session) return null;
    const params = { session: session.session, text, photo };
    const next = await this.connection.ask<P.Session>("replace", params);
    // What was applied is shown; a run of other data is no longer.
    const same = JSON.stringify(next.observe) === JSON.stringify(session.observe);
    this.store.set({ session: next, ...(same ? { view: "session", at: null } : NO_RUN) });
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
    const { session, wanting } = this.store.now;
    if (!session) {
      throw wanting
        ? new Refusal(`${wanting.program} needs a photograph`, PHOTO_HINT)
        : new Refusal("There is no program to run", "choose one at the top, or drop its file");
    }
    const params = { session: session.session, settings };
    await this.mine(async () => {
      const run = await this.connection.ask<P.Run>("run", params);
      this.keep(run);
      this.choose(run.run, "best");
    });
  }

  /** Opens or starts something: the events of it are no news of other tabs. */
  private mine(task: () => Promise<void>): Promise<void> {
    const done = task();
    this.own = done.catch(() => {});
    return done;
  }

  /** Pauses, goes on with, or stops a run. */
  async steer(method: "pause" | "go_on" | "stop", run: string): Promise<void> {
    this.keep(await this.connection.ask<P.Run>(method, { run }));
  }

  /** Forgets a run that ended; its folder stays. */
  async remove(run: string): Promise<void> {
    await this.connection.ask("remove", { run });
    if (this.store.now.run === run) this.store.set(NO_RUN);
    await this.readFolder();
  }

  /** Looks at another run. */
  choose(run: string, view: View = "best"): void {
    if (this.store.now.run === run) {
      this.store.set({ view });
      return;
    }
    this.store.set({ ...NO_RUN, run, view });
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

  /** Changes the session's state in a drag, which `last` ends; pictures follow it. */
  async drag<T extends P.Moved>(method: string, params: object, last: boolean): Promise<T | null> {
    const { store, connection } = this;
    const session = store.now.session?.session;
    if (session === undefined) return null;
    const answer = await connection.ask<T>(method, { session, ...params });
    const now = store.now.session;
    if (now && answer.revision > now.revision) {
      store.set({ session: { ...now, revision: answer.revision, log_joint: answer.log_joint } });
    }
    store.set({ moved: { coarse: !last } });
    return answer;
  }

  /** Reads the session again: its text and history, after a change. */
  refreshSession(): void {
    this.session.call();
  }

  /** Closes the session that this page opened before: their number is limited. Those that
   * other pages opened, or that runs still work for, stay. */
  private async closeLast(next: number | null): Promise<void> {
    const last = this.opened;
    this.opened = next;
    const works = this.store.now.runs.some((run) => run.session === last && isLive(run));
    if (last === null || works) return;
    await this.connection.ask("close", { session: last });
  }

  private take(event: P.Event): void {
    if (event.event === "folder") this.folder.call();
    else if (event.event === "run") {
      const isKnown = this.store.now.runs.some((r) => r.run === event.run.run);
      this.keep(event.run);
      if (!isKnown && this.store.now.folder) void this.own.then(() => this.tellRun(event.run));
    } else if (event.event === "opened") {
      void this.own.then(() => this.tellOpened(event));
    } else if (event.event === "closed") {
      void this.own.then(() => this.followClosed(event.session));
    } else {
      const { session, dragging } = this.store.now;
      if (session?.session !== event.session) return;
      if (event.revision <= session.revision) return;
      this.store.set({ session: { ...session, revision: event.revision } });
      if (!dragging) this.session.call();
    }
  }

  /** A run that another tab started: in the same session it is shown here, too. */
  private tellRun({ run, session, state }: P.Run): void {
    const { now } = this.store;
    if (session === null || run === now.run || state === "done" || state === "failed") return;
    const text = `Another tab started ${runName(run)}.`;
    if (session === now.session?.session) {
      this.choose(run);
      this.onTold(text);
    } else {
      this.onTold(text, { name: "Look", task: async () => this.choose(run) });
    }
  }

  private tellOpened({ session, program }: { session: number; program: string }): void {
    const { now } = this.store;
    if (now.session?.session === session || !now.folder) return;
    const task = () => this.showSession(session);
    this.onTold(`Another tab opened ${program}.`, { name: "Show it here", task });
  }

  /** Another tab opened something else in place of this page's session: so does this page. */
  private async followClosed(closed: number): Promise<void> {
    if (this.store.now.session?.session !== closed) return;
    await this.readFolder();
    const sessions = this.store.now.folder?.sessions ?? [];
    const next = sessions[sessions.length - 1];
    if (next === undefined) {
      this.store.set({ session: null, ...NO_RUN });
      this.onTold("Another tab closed the program.");
      return;
    }
    await this.showSession(next);
    this.onTold(`Another tab opened ${this.store.now.session?.program}, which is shown here, too.`);
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
    if (now?.session !== id || session.revision < now.revision) return;
    // Another tab may have chosen another photograph.
    const same = session.photo?.name === now.photo?.name;
    const photo = same ? {} : { photo: session.photo?.name ?? null, ...NO_RUN };
    this.store.set({ session, ...photo });
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
    if (this.store.now.run !== run.run) return;
    this.store.set({ modes: summary.modes.length, warnings: summary.warnings });
  }
}
