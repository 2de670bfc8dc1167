// The keys, and the licences of the page's parts.

import { button, h } from "./dom";

const KEYS: [string, string][] = [
  ["Ctrl-Enter", "apply the program to the session"],
  ["Ctrl-S", "save the program"],
  ["Shift-Alt-F", "format the program"],
  ["Ctrl-Space", "complete"],
  ["F2, F12, Shift-F12", "rename, definition, references"],
  ["Alt-R", "start a run"],
  ["Arrow keys", "in the trace: choose; on a slider: change; in 3D: turn"],
  ["+ and −", "in 3D: nearer and further"],
  ["Arrows, Space, Esc", "on the photograph with a tool: move, press, give up"],
  ["Tab", "at the prompt: complete"],
  ["Drag a number", "change it; with Shift slowly"],
];

/** A button that opens the help. */
export function helpButton(): HTMLElement {
  const close = button("Close", () => dialog.close(), { class: "primary" });
  const rows = KEYS.map(([key, what]) => {
    return h("tr", {}, h("td", {}, h("kbd", {}, key)), h("td", {}, what));
  });
  const licences = h("a", { href: "licences.txt", target: "_blank" }, "Licences");
  const dialog = h(
    "dialog",
    { "aria-label": "Help" },
    h("h2", {}, "Keys"),
    h("table", {}, h("tbody", {}, ...rows)),
    h("p", { class: "muted" }, licences, " of the parts that this page is made of."),
    close,
  );
  const about = { class: "quiet", title: "Keys and licences" };
  const open = button("?", () => dialog.showModal(), about);
  open.setAttribute("aria-label", "Help");
  return h("span", {}, open, dialog);
}
