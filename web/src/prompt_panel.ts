// The tab Prompt: lines entered into the session, and what it answers.

import type { Actions } from "./actions";
import { Latest } from "./connection";
import { button, h } from "./dom";
import { explain } from "./errors";
import { askPicture } from "./studio_data";

interface Completion {
  from: number;
  words: { word: string; about: string | null }[];
}

const KEPT = 200;

/** A prompt like that of `pcadlang repl`, with history and completion. */
export class PromptPanel {
  readonly element: HTMLElement;
  private readonly output = h("div", {
    class: "output scroll",
    "aria-live": "polite",
    tabindex: 0,
  });
  private readonly input = h("textarea", {
    rows: 1,
    "aria-label": "Prompt",
    spellcheck: "false",
    autocomplete: "off",
    placeholder: "a directive, an expression, @address, or :help",
  });
  private readonly words = h("ul", { class: "words", role: "listbox", hidden: true });
  private history: string[] = readHistory();
  private at = this.history.length;
  private completion: Completion | null = null;
  private chosen = 0;
  private readonly completes = new Latest<void>(() => this.complete(), () => this.closeWords());

  constructor(private readonly actions: Actions) {
    this.input.addEventListener("keydown", (event) => this.key(event));
    this.input.addEventListener("input", () => {
      this.grow();
      if (this.completion) this.completes.call();
    });
    this.input.addEventListener("blur", () => this.closeWords());
    this.element = h(
      "div",
      { class: "panel prompt" },
      this.output,
      h("div", { class: "entry" }, h("code", {}, "pcad>"), this.input, this.words),
    );
    this.print("Entries change the session, as those of `pcadlang repl`. Tab completes.", "muted");
  }

  /** The tab is shown, or no longer. */
  setVisible(visible: boolean): void {
    if (visible) this.input.focus({ preventScroll: true });
  }

  private key(event: KeyboardEvent): void {
    const words = this.completion?.words ?? [];
    if (words.length > 0 && this.wordKey(event, words.length)) {
      event.preventDefault();
      return;
    }
    const oneLine = !this.input.value.includes("\n");
    if (event.key === "Enter" && !event.shiftKey && !isOpen(this.input.value)) {
      void this.enter(this.input.value);
    } else if (event.key === "Tab" && !event.shiftKey && this.input.value.trim() !== "") {
      this.completes.call();
    } else if (event.key === "ArrowUp" && oneLine) this.recall(-1);
    else if (event.key === "ArrowDown" && oneLine) this.recall(1);
    else return;
    event.preventDefault();
  }

  private wordKey(event: KeyboardEvent, count: number): boolean {
    if (event.key === "Escape") this.closeWords();
    else if (event.key === "ArrowDown") this.choose((this.chosen + 1) % count);
    else if (event.key === "ArrowUp") this.choose((this.chosen + count - 1) % count);
    else if (event.key === "Tab" || event.key === "Enter") this.accept(this.chosen);
    else return false;
    return true;
  }

  private recall(by: number): void {
    this.at = Math.min(this.history.length, Math.max(0, this.at + by));
    this.input.value = this.history[this.at] ?? "";
    this.grow();
  }

  private async enter(text: string): Promise<void> {
    if (text.trim() === "") return;
    this.closeWords();
    this.history = [...this.history.filter((line) => line !== text), text].slice(-KEPT);
    this.at = this.history.length;
    localStorage.setItem("pcadlang-history", JSON.stringify(this.history));
    this.input.value = "";
    this.grow();
    this.print(`pcad> ${text.replaceAll("\n", "\n    > ")}`, "said");
    this.input.disabled = true;
    try {
      const reply = await this.actions.enter(text);
      if (reply.clears) this.output.replaceChildren();
      if (reply.text !== "") this.print(reply.text);
      if (reply.picture) await this.printPicture();
      if (reply.confirm) this.confirm(reply.confirm);
      this.actions.refreshSession();
    } catch (error) {
      const { message, hint } = explain(error);
      // The message is whole already where it quotes the program.
      const more = hint !== null && !message.includes(hint) ? `\n  = hint: ${hint}` : "";
      const whole = `${message}${more}`;
      this.print(whole.startsWith("error") ? whole : `error: ${whole}`, "failed");
    }
    this.input.disabled = false;
    this.input.focus({ preventScroll: true });
  }

  private confirm(confirm: { question: string; then: string }): void {
    const line = h("div", { class: "confirm" }, confirm.question);
    const answer = (then: string | null) => {
      line.remove();
      if (then !== null) void this.enter(then);
    };
    line.append(button("Yes", () => answer(confirm.then)), button("No", () => answer(null)));
    this.output.append(line);
    this.scroll();
  }

  private async printPicture(): Promise<void> {
    const { store, connection } = this.actions;
    const session = store.now.session!;
    const layer = session.photo ? "overlay" : "scene";
    const picture = await askPicture(connection, { session: session.session }, layer, 512);
    const image = h("img", { src: picture.url, alt: "The session's state" });
    this.output.append(image);
    await image.decode();
    this.scroll();
  }

  private print(text: string, kind = ""): void {
    this.output.append(h("pre", { class: kind }, text));
    while (this.output.childElementCount > 2000) this.output.firstElementChild!.remove();
    this.scroll();
  }

  private scroll(): void {
    this.output.scrollTop = this.output.scrollHeight;
  }

  private async complete(): Promise<void> {
    const { store, connection } = this.actions;
    const session = store.now.session?.session;
    if (session === undefined) return;
    const text = this.input.value;
    const at = byteLength(text.slice(0, this.input.selectionStart));
    const answer = await connection.ask<Completion>("complete", { session, text, at });
    if (this.input.value !== text || answer.words.length === 0) {
      this.closeWords();
      return;
    }
    this.completion = answer;
    if (answer.words.length === 1) this.accept(0);
    else this.choose(0);
  }

  private choose(index: number): void {
    this.chosen = index;
    const lines = (this.completion?.words ?? []).slice(0, 100).map(({ word, about }, i) => {
      const line = h("li", { role: "option", "aria-selected": String(i === index) });
      line.append(h("code", {}, word), h("span", { class: "muted" }, about ?? ""));
      line.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        this.accept(i);
      });
      return line;
    });
    this.words.replaceChildren(...lines);
    this.words.hidden = false;
    lines[index]?.scrollIntoView({ block: "nearest" });
  }

  private accept(index: number): void {
    const { completion } = this;
    const word = completion?.words[index]?.word;
    if (!completion || word === undefined) return;
    const text = this.input.value;
    const from = charOffset(text, completion.from);
    const end = this.input.selectionStart;
    this.input.value = text.slice(0, from) + word + text.slice(end);
    this.input.selectionStart = this.input.selectionEnd = from + word.length;
    this.closeWords();
    this.grow();
  }

  private closeWords(): void {
    this.completion = null;
    this.words.hidden = true;
  }

  private grow(): void {
    this.input.rows = Math.min(12, this.input.value.split("\n").length);
  }
}

/** True if a bracket is still open, so that the entry goes on in the next line. */
export function isOpen(text: string): boolean {
  let depth = 0;
  let inString = false;
  const code = text.replace(/\/\/.*$/gm, "");
  for (let i = 0; i < code.length; i++) {
    const c = code[i]!;
    if (inString && c === "\\") i++;
    else if (c === '"') inString = !inString;
    else if (!inString && "([{".includes(c)) depth++;
    else if (!inString && ")]}".includes(c)) depth--;
  }
  return depth > 0;
}

/** How many bytes a text has in UTF-8: the protocol counts those. */
export function byteLength(text: string): number {
  return new TextEncoder().encode(text).length;
}

/** The place in a text of a place counted in bytes. */
export function charOffset(text: string, bytes: number): number {
  const encoded = new TextEncoder().encode(text);
  return new TextDecoder().decode(encoded.slice(0, bytes)).length;
}

function readHistory(): string[] {
  try {
    const lines = JSON.parse(localStorage.getItem("pcadlang-history") ?? "[]");
    return Array.isArray(lines) ? lines.map(String) : [];
  } catch {
    return [];
  }
}
