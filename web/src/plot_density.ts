// Densities: how the draws of each chain are distributed.

import { canvas, themeColour } from "./canvas";
import { chainColour } from "./colour_map";
import { h, number } from "./dom";
import { finite, histogram, range } from "./plot_data";
import type { Quantity } from "./protocol";

const BINS = 40;
const HEIGHT = 130;

/** The distribution of a quantity, one line a chain. */
export function densityPlot(quantity: Quantity, width: number): HTMLElement {
  const [low, high] = range(finite(quantity));
  const chains = quantity.chains.map((chain) => {
    const xs = finite({ ...quantity, chains: [chain] });
    return histogram(xs, low, high, BINS).map((count) => count / Math.max(1, chain.length));
  });
  const top = Math.max(1e-9, ...chains.flat());
  const label = `Distribution of ${quantity.name} in ${chains.length} chains`;
  const picture = canvas(width, HEIGHT, label, (context) => {
    const base = HEIGHT - 18;
    const bin = (width - 8) / BINS;
    chains.forEach((shares, chain) => {
      context.strokeStyle = context.fillStyle = chainColour(chain);
      context.beginPath();
      context.moveTo(4, base);
      shares.forEach((share, i) => {
        const y = base - (share / top) * (base - 4);
        context.lineTo(4 + i * bin, y);
        context.lineTo(4 + (i + 1) * bin, y);
      });
      context.lineTo(width - 4, base);
      context.stroke();
      context.globalAlpha = 0.15;
      context.fill();
      context.globalAlpha = 1;
    });
    context.fillStyle = themeColour("muted");
    if (!Number.isFinite(low)) return;
    context.textAlign = "left";
    context.fillText(number(low), 4, HEIGHT - 5);
    context.textAlign = "right";
    context.fillText(number(high), width - 4, HEIGHT - 5);
  });
  return h("figure", { class: "plot" }, picture);
}
