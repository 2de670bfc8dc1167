// Canvases that are sharp on every screen and take the colours of the page.

import { h } from "./dom";

/** A colour of the page's theme, which a report has at its plots only. */
export function themeColour(name: string): string {
  return getComputedStyle(document.querySelector(".plots") ?? document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** A canvas of a size in CSS pixels, drawn by a function in those units. */
export function canvas(
  width: number,
  height: number,
  label: string,
  draw: (context: CanvasRenderingContext2D) => void,
): HTMLCanvasElement {
  const scale = Math.min(devicePixelRatio, 3);
  const element = h("canvas", {
    width: Math.round(width * scale),
    height: Math.round(height * scale),
    role: "img",
    "aria-label": label,
  });
  element.style.width = `${width}px`;
  element.style.height = `${height}px`;
  const context = element.getContext("2d");
  if (!context) return element;
  context.scale(scale, scale);
  context.font = `11px ${themeColour("sans")}`;
  draw(context);
  return element;
}

/** Round numbers between two bounds, for an axis. */
export function ticks(low: number, high: number, count: number): number[] {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough) ?? rough;
  const result: number[] = [];
  for (let x = Math.ceil(low / step) * step; x <= high + 1e-9 * step; x += step) {
    result.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  }
  return result;
}
