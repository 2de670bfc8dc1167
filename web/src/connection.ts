// One WebSocket to the program: requests with one answer each, events, and reconnection; tasks of
// which only the newest matters.

import { readFrame, type BinaryAnswer, type Diagnostic, type Event } from "./protocol";

/** An error that the program answered, with its hint. */
export class Refusal extends Error {
  constructor(
    message: string,
    readonly hint: string | null = null,
    readonly diagnostics: Diagnostic[] = [],
  ) {
    super(message);
  }
}

/** The request got no answer since the connection was lost. */
export class Disconnected extends Error {
  constructor() {
    super("the connection to pcadlang was lost");
  }
}

interface Waiting {
  resolve(value: unknown): void;
  reject(error: Error): void;
}

const FIRST_WAIT = 250;
const LONGEST_WAIT = 8000;

/** A connection that is made again, at growing intervals, whenever it is lost. */
export class Connection {
  onEvent: (event: Event) => void = () => {};
  /** Called when the connection is made (again) and when it is lost. */
  onChange: (connected: boolean) => void = () => {};

  private socket: WebSocket | null = null;
  private waiting = new Map<number, Waiting>();
  private nextId = 1;
  private wait = FIRST_WAIT;

  constructor(readonly token: string) {}

  /** Connects, and goes on trying. */
  connect(): void {
    const socket = new WebSocket(this.socketAddress("/socket"));
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = FIRST_WAIT;
      this.onChange(true);
    };
    socket.onmessage = (message) => this.receive(message.data as string | ArrayBuffer);
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.socket = null;
      for (const { reject } of this.waiting.values()) reject(new Disconnected());
      this.waiting.clear();
      this.onChange(false);
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    };
  }

  /** The address of a WebSocket of the program. */
  socketAddress(path: string): string {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    return `${scheme}://${location.host}${path}?token=${encodeURIComponent(this.token)}`;
  }

  /** The address of a file of the opened folder. */
  fileAddress(file: string): string {
    const path = file.split("/").map(encodeURIComponent).join("/");
    return `/files/${path}?token=${encodeURIComponent(this.token)}`;
  }

  /** Sends a request; its result, or a Refusal. */
  ask<T>(method: string, params: object = {}): Promise<T> {
    return this.send(method, params) as Promise<T>;
  }

  /** Sends a request whose answer is a binary frame. */
  askBinary(method: string, params: object): Promise<BinaryAnswer> {
    return this.send(method, params) as Promise<BinaryAnswer>;
  }

  /** Stores a photograph in the folder; the file it became. */
  async upload(file: File): Promise<string> {
    const query = `token=${encodeURIComponent(this.token)}&name=${encodeURIComponent(file.name)}`;
    const answer = await fetch(`/pictures?${query}`, { method: "POST", body: file });
    const text = await answer.text();
    if (!answer.ok) throw uploadError(answer.status, text);
    return (JSON.parse(text) as { file: string }).file;
  }

  private send(method: string, params: object): Promise<unknown> {
    const socket = this.socket;
    if (!socket || socket.readyState !== WebSocket.OPEN) return Promise.reject(new Disconnected());
    const id = this.nextId++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      socket.send(JSON.stringify({ id, method, params }));
    });
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data !== "string") {
      const answer = readFrame(data);
      this.take(answer.header.id)?.resolve(answer);
      return;
    }
    const message = JSON.parse(data);
    if ("event" in message) {
      this.onEvent(message as Event);
      return;
    }
    const waiting = this.take(message.id);
    if (!waiting) return;
    if (message.error) {
      const { message: text, hint, diagnostics } = message.error;
      waiting.reject(new Refusal(text, hint ?? null, diagnostics ?? []));
    } else {
      waiting.resolve(message.result);
    }
  }

  private take(id: number): Waiting | undefined {
    const waiting = this.waiting.get(id);
    this.waiting.delete(id);
    return waiting;
  }
}

function uploadError(status: number, text: string): Refusal {
  try {
    const { error, message, hint } = JSON.parse(text);
    return new Refusal(error?.message ?? message ?? text, error?.hint ?? hint ?? null);
  } catch {
    return new Refusal(text || `the photograph was refused (${status})`);
  }
}

/** Runs a task one at a time; of the calls made meanwhile only the last one is run: what keeps
 * dragging smooth however slow the program answers. */
export class Latest<A> {
  /** Resolved when nothing is left to do. */
  rest: Promise<void> = Promise.resolve();
  private running = false;
  private next: { request: A } | null = null;

  constructor(
    private readonly task: (request: A) => Promise<void>,
    private readonly onError: (error: unknown) => void = () => {},
  ) {}

  /** True while a request is worked on or waits. */
  get busy(): boolean {
    return this.running;
  }

  /** True if a request waits that is newer than the one worked on. */
  get waiting(): boolean {
    return this.next !== null;
  }

  /** Asks for the task with a new request. */
  call(request: A): void {
    this.next = { request };
    if (!this.running) this.rest = this.work();
  }

  private async work(): Promise<void> {
    this.running = true;
    while (this.next) {
      const { request } = this.next;
      this.next = null;
      try {
        await this.task(request);
      } catch (error) {
        this.onError(error);
      }
    }
    this.running = false;
  }
}
