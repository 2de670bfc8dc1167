// At most one request under way, and the newest wish wins: what keeps dragging smooth however
// slow the program answers.

/** Runs a task one at a time; of the calls made meanwhile only the last one is run. */
export class Latest<A> {
  private running = false;
  private next: { wish: A } | null = null;

  constructor(
    private readonly task: (wish: A) => Promise<void>,
    private readonly onError: (error: unknown) => void = () => {},
  ) {}

  /** Asks for the task with a new wish. */
  call(wish: A): void {
    this.next = { wish };
    if (!this.running) void this.work();
  }

  /** Whether a call is under way. */
  get busy(): boolean {
    return this.running;
  }

  private async work(): Promise<void> {
    this.running = true;
    while (this.next) {
      const { wish } = this.next;
      this.next = null;
      try {
        await this.task(wish);
      } catch (error) {
        this.onError(error);
      }
    }
    this.running = false;
  }
}
