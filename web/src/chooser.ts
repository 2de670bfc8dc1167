// Choosing a program and a photograph: what the top bar, the first page and a missing photograph
// offer, with one place for what goes wrong.

import type { Actions } from "./actions";
import { Refusal } from "./connection";
import { button, h } from "./dom";
import type { ErrorBox } from "./errors";

const PICTURES = "image/png,image/jpeg";
const FIRST = `// A value that nobody knows,
// and what was seen of it:
// change them, then Start.
assume mean ~ normal(0, 10);
observe normal(mean, 1) = 3.2 as seen;
`;

/** Opens what the user chooses. */
export class Chooser {
  /** The dialogs for files; they are part of the page so that tests and assistants find them. */
  readonly element: HTMLElement;
  private readonly pictures = h("input", { type: "file", accept: PICTURES, hidden: true });
  private readonly programs = h("input", { type: "file", accept: ".pcad", hidden: true });

  constructor(
    readonly actions: Actions,
    private readonly error: ErrorBox,
  ) {
    for (const input of [this.pictures, this.programs]) {
      input.addEventListener("change", () => {
        const file = input.files?.[0];
        if (file) this.take(file);
        input.value = "";
      });
    }
    this.pictures.setAttribute("aria-label", "A photograph's file");
    this.programs.setAttribute("aria-label", "A program's file");
    this.element = h("span", { hidden: true }, this.pictures, this.programs);
  }

  /** Opens a program. */
  program(file: string): void {
    void this.error.guard(() => this.actions.openProgram(file));
  }

  /** Opens a new program, which works as it is, under a name that is free. */
  newProgram(): void {
    void this.error.guard(() => this.actions.takeProgram("new.pcad", FIRST));
  }

  /** Takes a photograph of the folder, or none. */
  photo(file: string | null): void {
    void this.error.guard(() => this.actions.choosePhoto(file));
  }

  /** Takes a photograph that comes with pcadlang. */
  example(picture: string): void {
    void this.error.guard(() => this.actions.chooseExample(picture));
  }

  /** Asks for the file of a photograph. */
  pictureFile(): void {
    this.pictures.click();
  }

  /** Asks for the file of a program. */
  programFile(): void {
    this.programs.click();
  }

  /** Takes a photograph or a program that was chosen or dropped. */
  take(file: File): void {
    void this.error.guard(async () => {
      if (file.name.endsWith(".pcad")) {
        return this.actions.takeProgram(file.name, await file.text());
      }
      if (!/^image\/(png|jpeg)$/.test(file.type)) {
        const hint = "drop a photograph (PNG or JPEG) or a program (.pcad)";
        throw new Refusal(`${file.name} is neither a photograph nor a program`, hint);
      }
      return this.actions.choosePhoto(await this.actions.connection.upload(file));
    });
  }

  /** The example for the chosen program, or all of them where that has none of its own. */
  examples(): string[] {
    const { folder, session, wanting } = this.actions.store.now;
    const program = wanting?.program ?? session?.program;
    const own = folder?.programs.find((p) => p.file === program)?.example;
    return own ? [own] : (folder?.examples ?? []);
  }

  /** Buttons for an example and a file. */
  photoButtons(kind = "primary"): HTMLElement[] {
    const examples = this.examples().map((picture) => {
      const title = "A photograph that comes with pcadlang";
      return button(`Example: ${picture}`, () => this.example(picture), { class: kind, title });
    });
    return [...examples, button("A file …", () => this.pictureFile())];
  }
}
