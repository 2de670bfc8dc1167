// Pairs: scatter plots of each two of up to four quantities, histograms on the diagonal.

import { canvas, themeColour } from "./canvas";
import { chainColour } from "./colour_map";
import { h, number } from "./dom";
import { finite, histogram, range } from "./plot_data";
import type { Quantity } from "./protocol";

/** As many quantities as have room beside each other. */
export const MOST_PAIRS = 4;

/** The scatter matrix of some quantities. */
export function pairsPlot(quantities: Quantity[], width: number): HTMLElement {
  const shown = quantities.slice(0, MOST_PAIRS);
  const n = shown.length;
  const left = 10;
  const cell = Math.min(200, (width - left - 6) / n);
  const ranges = shown.map((q) => range(finite(q)));
  const label = `Scatter plots of ${shown.map((q) => q.name).join(", ")}`;
  const height = n * cell + 22;
  const picture = canvas(left + n * cell + 6, height, label, (context) => {
    for (let row = 0; row < n; row++) {
      for (let column = 0; column <= row; column++) {
        const box = { x: left + column * cell + 3, y: row * cell + 3, size: cell - 6 };
        context.strokeStyle = themeColour("line-strong");
        context.strokeRect(box.x, box.y, box.size, box.size);
        if (row === column) drawHistogram(context, shown[row]!, ranges[row]!, box);
        else drawPoints(context, shown[column]!, shown[row]!, ranges[column]!, ranges[row]!, box);
      }
      context.fillStyle = themeColour("muted");
      const [low, high] = ranges[row]!;
      context.textAlign = "left";
      context.fillText(number(low, 3), left + row * cell + 3, n * cell + 14);
      context.textAlign = "right";
      context.fillText(number(high, 3), left + (row + 1) * cell - 3, n * cell + 14);
    }
  });
  return h("figure", { class: "plot" }, picture);
}

interface Box {
  x: number;
  y: number;
  size: number;
}

function drawHistogram(
  context: CanvasRenderingContext2D,
  quantity: Quantity,
  [low, high]: [number, number],
  box: Box,
): void {
  const bins = 24;
  const counts = histogram(finite(quantity), low, high, bins);
  const top = Math.max(1, ...counts);
  context.fillStyle = themeColour("accent");
  context.globalAlpha = 0.65;
  counts.forEach((count, i) => {
    const tall = (count / top) * (box.size - 24);
    const width = box.size / bins;
    context.fillRect(box.x + i * width, box.y + box.size - tall, width - 0.5, tall);
  });
  context.globalAlpha = 1;
  context.fillStyle = themeColour("text");
  context.textAlign = "left";
  context.fillText(quantity.name, box.x + 5, box.y + 14, box.size - 10);
}

function drawPoints(
  context: CanvasRenderingContext2D,
  a: Quantity,
  b: Quantity,
  [lowA, highA]: [number, number],
  [lowB, highB]: [number, number],
  box: Box,
): void {
  const total = a.chains.reduce((sum, chain) => sum + chain.length, 0);
  // Many points are drawn fainter, so that where they are dense stays visible.
  context.globalAlpha = Math.min(0.8, Math.max(0.08, 250 / Math.max(1, total)));
  a.chains.forEach((xs, chain) => {
    context.fillStyle = chainColour(chain);
    xs.forEach((x, i) => {
      const y = b.chains[chain]?.[i];
      if (x === null || y === null || y === undefined) return;
      const px = box.x + ((x - lowA) / (highA - lowA)) * box.size;
      const py = box.y + box.size - ((y - lowB) / (highB - lowB)) * box.size;
      context.fillRect(px - 1, py - 1, 2, 2);
    });
  });
  context.globalAlpha = 1;
}
