// A list of many lines of equal height, of which only those in sight exist.

import { h } from "./dom";

/** A scrolling list; lines are made when they come into sight. */
export class VirtualList {
  readonly element = h("div", { class: "virtual" });
  private readonly space = h("div", { class: "virtual-space" });
  private count = 0;
  private first = -1;
  private last = -1;

  constructor(
    private readonly height: number,
    private readonly line: (index: number) => HTMLElement,
  ) {
    this.element.append(this.space);
    this.element.addEventListener("scroll", () => this.draw(false), { passive: true });
    new ResizeObserver(() => this.draw(false)).observe(this.element);
  }

  /** Shows so many lines, all made anew. */
  update(count: number): void {
    this.count = count;
    this.space.style.height = `${count * this.height}px`;
    this.draw(true);
  }

  /** Scrolls a line into sight. */
  reveal(index: number): void {
    const top = index * this.height;
    const { scrollTop, clientHeight } = this.element;
    if (top < scrollTop) this.element.scrollTop = top;
    else if (top + this.height > scrollTop + clientHeight) {
      this.element.scrollTop = top + this.height - clientHeight;
    }
    this.draw(false);
  }

  private draw(anew: boolean): void {
    const { scrollTop, clientHeight } = this.element;
    const first = Math.max(0, Math.floor(scrollTop / this.height) - 4);
    const last = Math.min(this.count, Math.ceil((scrollTop + clientHeight) / this.height) + 4);
    if (!anew && first === this.first && last === this.last) return;
    this.first = first;
    this.last = last;
    const lines: HTMLElement[] = [];
    for (let i = first; i < last; i++) {
      const line = this.line(i);
      line.style.top = `${i * this.height}px`;
      line.style.height = `${this.height}px`;
      lines.push(line);
    }
    this.space.replaceChildren(...lines);
  }
}
