// At most one request under way, and the newest one wins: what keeps dragging smooth however
// slow the program answers.

/** Runs a task one at a time; of the calls made meanwhile only the last one is run. */
export class Latest<A> {
  private running = false;
  private next: { request: A } | null = null;

  constructor(
    private readonly task: (request: A) => Promise<void>,
    private readonly onError: (error: unknown) => void = () => {},
  ) {}

  /** Asks for the task with a new request. */
  call(request: A): void {
    this.next = { request };
    if (!this.running) void this.work();
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
