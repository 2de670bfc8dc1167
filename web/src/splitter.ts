// The bars between columns, which the pointer and the arrow keys move.

import { h } from "./dom";

/** A bar that sets a CSS variable of the page to a width in pixels, and remembers it. */
export function splitter(variable: string, label: string, initial: number, side: 1 | -1) {
  const key = `pcadlang${variable}`;
  let width = Number(localStorage.getItem(key)) || initial;
  const element = h("div", {
    class: "splitter",
    role: "separator",
    tabindex: "0",
    "aria-orientation": "vertical",
    "aria-label": label,
  });
  const set = (to: number) => {
    width = Math.min(900, Math.max(220, to));
    document.documentElement.style.setProperty(variable, `${width}px`);
    element.setAttribute("aria-valuenow", String(Math.round(width)));
    localStorage.setItem(key, String(Math.round(width)));
  };
  set(width);
  element.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -20, ArrowRight: 20 }[event.key];
    if (!by) return;
    event.preventDefault();
    set(width + side * by);
  });
  element.addEventListener("pointerdown", (down) => {
    const before = width;
    element.setPointerCapture(down.pointerId);
    const move = (event: PointerEvent) => set(before + side * (event.clientX - down.clientX));
    const up = () => element.removeEventListener("pointermove", move);
    element.addEventListener("pointermove", move);
    element.addEventListener("pointerup", up, { once: true });
    element.addEventListener("pointercancel", up, { once: true });
  });
  return element;
}
