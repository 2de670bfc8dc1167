// Rank plots: if chains mix, the ranks of each among all draws are uniform.

import { canvas, themeColour } from "./canvas";
import { chainColour } from "./colour_map";
import { h } from "./dom";
import { histogram, ranks } from "./plot_data";
import type { Quantity } from "./protocol";

const BINS = 20;
const ROW = 30;

/** A rank plot of one quantity: a row of bars for each chain. */
export function rankPlot(quantity: Quantity, width: number): HTMLElement {
  const rows = ranks(quantity.chains).map((r) => histogram(r, 0, 1, BINS));
  const height = rows.length * ROW + 4;
  const label = `Ranks of ${quantity.name} in ${rows.length} chains`;
  const picture = canvas(width, height, label, (context) => {
    const left = 56;
    const bin = (width - left - 10) / BINS;
    rows.forEach((counts, chain) => {
      const expected = counts.reduce((a, b) => a + b, 0) / BINS;
      const base = (chain + 1) * ROW - 2;
      // The expected height is half of the row: twice as many fill it.
      const unit = expected > 0 ? (ROW - 6) / 2 / expected : 0;
      context.fillStyle = chainColour(chain);
      counts.forEach((count, i) => {
        const tall = Math.min(ROW - 6, count * unit);
        context.fillRect(left + i * bin, base - tall, bin - 1, tall);
      });
      context.fillStyle = themeColour("muted");
      context.textAlign = "right";
      context.fillText(`chain ${chain + 1}`, left - 6, base - 7);
      context.strokeStyle = themeColour("text");
      context.setLineDash([3, 3]);
      context.beginPath();
      context.moveTo(left, base - (ROW - 6) / 2);
      context.lineTo(width - 10, base - (ROW - 6) / 2);
      context.stroke();
    });
  });
  return h("figure", { class: "plot" }, picture);
}
