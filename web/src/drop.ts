// Photographs and programs dropped anywhere on the page.

import { h } from "./dom";

/** Calls back with each file that is dropped; the page says so while one is held over it. */
export function acceptDrops(root: HTMLElement, take: (file: File) => void): void {
  const text = "Drop a photograph (PNG, JPEG) or a program (.pcad)";
  const hint = h("div", { class: "drop-hint", hidden: true }, text);
  root.append(hint);
  const holdsFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  document.addEventListener("dragover", (event) => {
    if (!holdsFiles(event)) return;
    event.preventDefault();
    hint.hidden = false;
  });
  document.addEventListener("dragleave", (event) => {
    // Leaving a child is no leaving; only the page's edge has no element beyond it.
    if (event.relatedTarget === null) hint.hidden = true;
  });
  document.addEventListener("drop", (event) => {
    hint.hidden = true;
    const file = event.dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    take(file);
  });
}
