// The state of the page, and the listeners to its changes. Panels read from here and never from
// each other.

import type { Draws, Folder, Run, Session } from "./protocol";

/** The states that the viewer shows. */
export type View = "session" | "best" | "draws" | "film" | "modes";

export interface Known {
  connected: boolean;
  folder: Folder | null;
  session: Session | null;
  /** All runs of the folder, newest last. */
  runs: Run[];
  /** The run that is looked at. */
  run: string | null;
  /** The kept draws of that run, so far. */
  draws: Draws | null;
  /** How many modes that run has; 0 until it ended. */
  modes: number;
  view: View;
  /** The place of the slider in `view`; null: its end. */
  at: number | null;
  tab: string;
  /** A choice is being dragged: pictures may be coarse. */
  dragging: boolean;
}

type Listener = () => void;

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
  get currentRun(): Run | null {
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
