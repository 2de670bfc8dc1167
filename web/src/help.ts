// What the page is, part by part; the keys; the licences of what it is made of.

import { button, h } from "./dom";

const STEPS: [string, string][] = [
  ["Program", "what could be in the picture, as text: top left, or drop a .pcad file"],
  ["Photograph", "top left, or drop a PNG or JPEG anywhere; an example comes with the page"],
  ["Start", "applies the text and fits it to the photograph: quickly first, then accurately"],
  ["Point, Box, Axis, Outline", "over the photograph: say where the object is, then Start again"],
  ["Session, Best, Draws, Film, Modes", "which states are shown: yours, or those of the run"],
  ["Timeline", "beneath the picture: the kept states of each chain; drag along it"],
  ["Limbs", "beside the layers: drag a joint over the picture, and the body follows"],
  ["Trace", "every choice of the program: drag one, and the picture follows"],
  ["Plots, Modes, Compare", "how sure the answer is; other answers; two runs side by side"],
  ["Runs", "all runs of the folder, with warnings and files"],
];

const KEYS: [string, string][] = [
  ["Ctrl-Enter", "apply the program to the session"],
  ["Ctrl-S", "save the program"],
  ["Shift-Alt-F", "format the program"],
  ["Ctrl-Space", "complete"],
  ["F2, F12, Shift-F12", "rename, definition, references"],
  ["Alt-R", "start a run"],
  ["Arrow keys", "in the trace: choose; on a slider: change; in 3D: turn; on a joint: pull it"],
  ["← and →", "elsewhere: one state back and forth on the timeline"],
  ["+ and −", "in 3D: nearer and further"],
  ["Arrows, Space, Esc", "on the photograph with a tool: move, press, give up"],
  ["Tab", "at the prompt: complete"],
  ["Drag a number", "change it; with Shift slowly"],
];

/** A button that opens the help. */
export function helpButton(): HTMLElement {
  const close = button("Close", () => dialog.close(), { class: "primary" });
  const table = (rows: [string, string][], name: "b" | "kbd") => {
    const row = ([first, what]: [string, string]) => {
      return h("tr", {}, h("td", {}, h(name, {}, first)), h("td", {}, what));
    };
    return h("table", {}, h("tbody", {}, ...rows.map(row)));
  };
  const licences = h("a", { href: "licences.txt", target: "_blank" }, "Licences");
  const examples =
    " of the parts that this page is made of. Examples: coffee_cup.png by Rachel Michetti, CC0; " +
    "skier.jpg from Flickr (6795644157, by MS COCO), CC BY 2.0.";
  const dialog = h(
    "dialog",
    { "aria-label": "Help" },
    h("h2", { tabindex: "-1", autofocus: true }, "From a program and a photograph to a scene"),
    table(STEPS, "b"),
    h("h2", {}, "Keys"),
    table(KEYS, "kbd"),
    h("p", { class: "muted" }, licences, examples),
    close,
  );
  const about = { class: "quiet", title: "What this page does, and its keys" };
  const open = button("?", () => dialog.showModal(), about);
  open.setAttribute("aria-label", "Help");
  return h("span", {}, open, dialog);
}
