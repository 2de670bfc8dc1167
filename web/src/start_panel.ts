// The first page: which program, which photograph; and what a program lacks before it can open.

import { fill, button, h, select } from "./dom";
import type { Chooser } from "./chooser";
import { imageItem, type Program } from "./protocol";

/** Shown while no session is open. */
export class StartPanel {
  readonly element = h("div", { class: "start-panel" });
  private shown = "";

  constructor(private readonly chooser: Chooser) {}

  /** Shows what is chosen so far. */
  show(): void {
    const { folder, wanting, photo } = this.chooser.actions.store.now;
    const key = JSON.stringify([folder?.programs, folder?.pictures, wanting, photo]);
    if (key === this.shown || !folder) return;
    this.shown = key;
    const ask = wanting && photo === null;
    fill(
      this.element,
      ask ? this.asked(wanting.program, wanting.data) : null,
      h("div", { class: "start-columns" }, ...this.columns(Boolean(ask))),
    );
  }

  private asked(program: string, data: Parameters<typeof imageItem>[0]): HTMLElement {
    if (imageItem(data)) {
      const text = `${program} needs a photograph before anything can be shown.`;
      return h(
        "div",
        { class: "ask", role: "status" },
        h("p", {}, h("b", {}, text)),
        h("div", { class: "buttons" }, ...this.chooser.photoButtons()),
      );
    }
    const names = data.filter((d) => !d.given).map((d) => d.name).join(", ");
    const text = `${program} needs data: ${names}. Write in the program where they are, such as `;
    return h("div", { class: "ask", role: "status" }, text, h("code", {}, 'data d = csv("FILE");'));
  }

  private columns(hasAsked: boolean): HTMLElement[] {
    const { folder, photo, wanting } = this.chooser.actions.store.now;
    const programs = folder?.programs ?? [];
    const group = (title: string, all: Program[]) => {
      if (all.length === 0) return [];
      const cards = all.map((p) => this.card(p, wanting?.program === p.file));
      return [h("h3", {}, title), h("div", { class: "choices" }, ...cards)];
    };
    const of = (test: (p: Program) => boolean) => programs.filter(test);
    const program = h(
      "section",
      { "aria-label": "Choose a program" },
      h("h2", {}, wanting ? "Another program" : "Choose a program"),
      h(
        "div",
        { class: "buttons" },
        button("New program", () => this.chooser.newProgram()),
        button("A program's file …", () => this.chooser.programFile()),
      ),
      ...group("In this folder", of((p) => !p.shipped)),
      // Variants have longer names.
      ...group(
        "For a photograph",
        of((p) => p.shipped && Boolean(p.example)).sort((a, b) => a.file.length - b.file.length),
      ),
      ...group("Others that come with pcadlang", of((p) => p.shipped && !p.example)),
    );
    // Where a photograph is asked for, there may be no more to say of it.
    const isSaid = hasAsked && photo === null && (folder?.pictures ?? []).length === 0;
    return isSaid ? [program] : [program, this.photograph(photo, hasAsked)];
  }

  private card({ file, about }: Program, chosen: boolean): HTMLElement {
    const open = () => this.chooser.program(file);
    const attributes = { type: "button", class: "choice", onclick: open, "aria-pressed": `${chosen}` };
    return h("button", attributes, h("b", {}, file), h("span", { class: "muted" }, whole(about)));
  }

  private photograph(photo: string | null, hasAsked: boolean): HTMLElement {
    const { folder } = this.chooser.actions.store.now;
    const names: [string, string][] = (folder?.pictures ?? []).map((p) => [p, p]);
    const list = select([["", "No photograph"], ...names], photo ?? "", (file) => {
      this.chooser.photo(file === "" ? null : file);
    }, { "aria-label": "Photograph of the folder" });
    const image = photo === null ? null : h("img", {
      src: this.chooser.actions.connection.fileAddress(photo),
      alt: photo,
    });
    return h(
      "section",
      { "aria-label": "Choose a photograph" },
      h("h2", {}, "Choose a photograph"),
      // The same buttons stand above where one is asked for.
      hasAsked ? null : h("div", { class: "buttons" }, ...this.chooser.photoButtons("")),
      names.length > 0 ? list : null,
      image ?? h("p", { class: "muted" }, "Or drop one here. Programs without data need none."),
    );
  }
}

/** The whole sentences, or clauses, of a line that may go on in the next one. */
function whole(about: string | null): string {
  const text = about ?? "";
  return /[.!?]$/.test(text) ? text : text.replace(/[.;,] [^.;,]*$/, ".");
}
