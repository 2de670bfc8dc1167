// Trace plots: a quantity over the draws of each chain.

import uPlot from "uplot";
import { themeColour } from "./canvas";
import { chainColour } from "./colour_map";
import { h, number } from "./dom";
import type { Quantity } from "./protocol";

/** A trace plot of one quantity. */
export function tracePlot(quantity: Quantity, width: number, every: number): HTMLElement {
  const longest = Math.max(0, ...quantity.chains.map((c) => c.length));
  const x = Array.from({ length: longest }, (_, i) => i * every);
  const y = quantity.chains.map((chain) => {
    return Array.from({ length: longest }, (_, i) => chain[i] ?? null);
  });
  const axis = {
    stroke: themeColour("muted"),
    grid: { stroke: themeColour("line"), width: 1 },
    ticks: { show: false },
    font: `11px ${themeColour("sans")}`,
  };
  const element = h("figure", { class: "plot" });
  const options: uPlot.Options = {
    width,
    height: 130,
    legend: { show: false },
    cursor: { y: false, points: { show: false } },
    scales: { x: { time: false } },
    axes: [
      { ...axis, size: 24 },
      { ...axis, size: 56, space: 24, values: (_, values) => values.map((v) => number(v)) },
    ],
    series: [
      {},
      ...quantity.chains.map((_, i) => ({
        label: `chain ${i + 1}`,
        stroke: chainColour(i),
        width: 1,
        points: { show: false },
      })),
    ],
  };
  new uPlot(options, [x, ...y], element);
  return element;
}
