// The editor's column: the session's program and other opened files, Apply, Save, Format.

import { formatDocument } from "@codemirror/lsp-client";
import { EditorView } from "@codemirror/view";
import type { EditorState } from "@codemirror/state";
import type { Actions } from "./actions";
import { Refusal } from "./connection";
import { button, fill, h, select, setOptions } from "./dom";
import { editorState, replaceText, showDiagnostics } from "./editor";
import { ErrorBox } from "./errors";
import { LanguageServer } from "./language";
import type { Session, Wanting } from "./protocol";

interface OpenFile {
  file: string;
  state: EditorState;
  /** The text that the session or the file has: what differs from it is not applied. */
  base: string;
  text: string;
}

// Not the name of a file: these have an ending.
const SAVE_AS = "save as";

/** Programs, and what is done with them. */
export class ProgramPanel {
  readonly element: HTMLElement;
  private files: OpenFile[] = [];
  private current: OpenFile | null = null;
  private readonly view = new EditorView();
  private readonly error = new ErrorBox();
  private readonly row = h("div", { class: "file-row" });
  private readonly note = h("span", { class: "muted note", "aria-live": "polite" });
  private readonly apply = button("Apply", () => this.applyText(), { class: "primary" });
  private readonly open = select([["", "Open …"]], "", (file) => this.openFile(file), {
    "aria-label": "Open a program beside this one",
  });
  private readonly none = h("div", { class: "empty" }, "No program is chosen yet.");
  private readonly server: LanguageServer;

  constructor(private readonly actions: Actions) {
    const { store, connection } = actions;
    this.server = new LanguageServer(connection.socketAddress("/language"));
    const format = button("Format", () => void formatDocument(this.view), {
      title: "Format the program (Shift-Alt-F)",
    });
    const save = button("Save", () => this.save(), { title: "Write the file (Ctrl-S)" });
    this.element = h(
      "div",
      { class: "panel program" },
      h("div", { class: "panel-tools" }, this.apply, save, format, this.open, this.note),
      this.row,
      h("div", { class: "editor" }, this.view.dom),
      this.error.element,
    );
    this.describe();
    this.element.querySelector(".editor")!.prepend(this.none);
    actions.onOpened = (session) => this.showSession(session);
    store.on(["folder"], () => this.showFolder());
    store.on(["session"], () => this.follow());
  }

  private showFolder(): void {
    const programs = this.actions.store.now.folder?.programs ?? [];
    const options = programs.map(({ file, about }): [string, string] => {
      return [file, about ? `${file} – ${about}` : file];
    });
    const first: [string, string][] = [
      ["", "Open …"],
      [SAVE_AS, "Save as …"],
    ];
    setOptions(this.open, [...first, ...options], "");
  }

  private get sessionFile(): string | null {
    const { session, wanting } = this.actions.store.now;
    const opened = session ?? wanting;
    return opened ? opened.program || "untitled.pcad" : null;
  }

  /** A session was opened: its program comes to the front, with edits not yet applied. */
  private showSession(session: Session | Wanting): void {
    const file = session.program || "untitled.pcad";
    const before = this.files.find((f) => f.file === file);
    this.files = this.files.filter((f) => f !== before);
    const edited = before && before.text !== before.base ? before.text : null;
    const draft = edited ?? sessionStorage.getItem(this.draftKey(session.session, file));
    const opened = this.add(file, session.text, draft ?? session.text);
    this.files = [opened, ...this.files.filter((f) => f !== opened && f.text !== f.base)];
    this.show(opened);
    this.view.scrollDOM.scrollTo(0, 0);
    this.error.clear();
  }

  /** The session's program changed, at the prompt or in another tab of the browser. */
  private follow(): void {
    const session = this.actions.store.now.session;
    const opened = this.files.find((f) => f.file === this.sessionFile);
    if (!session || !opened || opened.base === session.text) return;
    const edited = opened.text !== opened.base;
    opened.base = session.text;
    if (!edited) {
      if (opened === this.current) replaceText(this.view, session.text);
      else {
        const changes = { from: 0, to: opened.state.doc.length, insert: session.text };
        opened.state = opened.state.update({ changes }).state;
        opened.text = session.text;
      }
    }
    this.describe();
  }

  private add(file: string, base: string, text = base): OpenFile {
    const opened: OpenFile = { file, base, text, state: null as unknown as EditorState };
    const keys = { apply: () => this.applyText(), save: () => this.save() };
    const changed = (now: string) => this.changed(opened, now);
    opened.state = editorState(text, keys, changed, this.server.extension(file));
    if (!this.files.includes(opened)) this.files.push(opened);
    return opened;
  }

  private show(opened: OpenFile): void {
    if (this.current && this.files.includes(this.current)) this.current.state = this.view.state;
    this.current = opened;
    this.view.setState(opened.state);
    this.describe();
  }

  private changed(opened: OpenFile, text: string): void {
    opened.text = text;
    const session = this.actions.store.now.session;
    if (session && opened.file === this.sessionFile) {
      const key = this.draftKey(session.session, opened.file);
      if (text === opened.base) sessionStorage.removeItem(key);
      else sessionStorage.setItem(key, text);
    }
    this.describe();
  }

  private describe(): void {
    const { current } = this;
    this.none.hidden = current !== null;
    this.view.dom.hidden = current === null;
    const ofSession = current === null || current.file === this.sessionFile;
    const edited = current !== null && current.text !== current.base;
    this.apply.textContent = ofSession ? "Apply" : "Use";
    this.apply.title = ofSession
      ? "Replace the session's program; shared choices keep their values (Ctrl-Enter)"
      : "Open a session of this program (Ctrl-Enter)";
    this.apply.disabled = ofSession && !edited;
    this.note.textContent = edited ? (ofSession ? "not applied" : "not saved") : "";
    const tabs = this.files.map((opened) => {
      const mark = opened.text === opened.base ? "" : " •";
      const tab = button(`${opened.file}${mark}`, () => this.show(opened), {
        "aria-pressed": String(opened === current),
      });
      if (opened.file === this.sessionFile) return tab;
      const close = button("×", () => this.close(opened), {
        class: "quiet",
        "aria-label": `Close ${opened.file}`,
      });
      return h("span", { class: "closable" }, tab, close);
    });
    fill(this.row, ...tabs);
    this.row.hidden = this.files.length < 2;
  }

  private close(opened: OpenFile): void {
    if (opened.text !== opened.base && !confirm(`Discard the changes of ${opened.file}?`)) return;
    this.files = this.files.filter((f) => f !== opened);
    const first = this.files[0];
    if (opened === this.current && first) this.show(first);
    else this.describe();
  }

  private openFile(file: string): void {
    this.open.value = "";
    if (file === SAVE_AS) {
      this.create(this.view.state.doc.toString());
      return;
    }
    const opened = this.files.find((f) => f.file === file);
    if (opened) {
      this.show(opened);
      return;
    }
    void this.error.guard(async () => {
      const { text } = await this.actions.connection.ask<{ text: string }>("read", { file });
      this.show(this.add(file, text));
    });
  }

  /** Makes a file with a text, under a name that the user chooses. */
  private create(text: string): void {
    const name = prompt("Save the program as", "new.pcad")?.trim();
    if (!name) return;
    const file = name.endsWith(".pcad") ? name : `${name}.pcad`;
    void this.error.guard(async () => {
      const opened = this.files.find((f) => f.file === file);
      const programs = this.actions.store.now.folder?.programs ?? [];
      const exists = opened || programs.some((p) => p.file === file && !p.shipped);
      if (exists) throw new Error(`${file} exists: choose another name`);
      await this.actions.connection.ask("write", { file, text });
      this.show(this.add(file, text));
    });
  }

  private applyText(): void {
    void this.error.guard(() => this.commit());
  }

  /** Makes the session that of the text on screen: what Start runs is what is seen. Fails with
   * the mistake, which is marked. */
  async commit(): Promise<void> {
    const { session } = this.actions.store.now;
    const own = this.files.find((f) => f.file === this.sessionFile);
    // A file that is open beside the session's counts only while it is in sight.
    const isSeen = this.element.checkVisibility({ visibilityProperty: true });
    const shown = isSeen ? this.current : (own ?? this.current);
    if (!shown || (shown === own && shown.text === shown.base)) return;
    try {
      if (shown !== own || !session) {
        await this.useProgram(shown);
        return;
      }
      const next = await this.actions.replace(shown.text);
      if (!next) return;
      shown.base = next.text;
      this.changed(shown, shown.text);
    } catch (error) {
      const isMarked = error instanceof Refusal && shown === this.current;
      if (isMarked) showDiagnostics(this.view, error.diagnostics);
      throw error;
    }
    this.error.clear();
  }

  /** Opens a session of a file that was only looked at, with the photograph at hand. */
  private async useProgram(opened: OpenFile): Promise<void> {
    if (opened.text !== opened.base) await this.write(opened);
    await this.actions.openProgram(opened.file);
    this.files = this.files.filter((f) => f !== opened);
    this.describe();
  }

  private save(): void {
    const { current } = this;
    if (!current) return;
    void this.error.guard(async () => {
      await this.write(current);
      this.note.textContent = `saved as ${current.file}`;
    });
  }

  /** Where text that is not applied is kept; another start of the program has other sessions. */
  private draftKey(session: number | null, file: string): string {
    return `draft ${this.actions.connection.token.slice(0, 8)} ${session} ${file}`;
  }

  private async write(opened: OpenFile): Promise<void> {
    const { text, file } = opened;
    await this.actions.connection.ask("write", { file, text });
    // The session has its own text: it changes with Apply, not with Save.
    if (file !== this.sessionFile || !this.actions.store.now.session) opened.base = text;
    this.describe();
  }
}
