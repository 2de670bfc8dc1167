// The plots of report.html: traces, densities and ranks of the draws that lie in the page.

import uplot from "uplot/dist/uPlot.min.css";
import plotStyle from "./plots.css";
import { h } from "./dom";
import { readQuantities, type EmbeddedDraws } from "./embedded_draws";
import { densityPlot } from "./plot_density";
import { rankPlot } from "./plot_rank";
import { tracePlot } from "./plot_trace";
import { themed } from "./standalone_theme";

const NARROW = 700;

async function start(): Promise<void> {
  const text = document.getElementById("plot-data")?.textContent;
  const places = [...document.querySelectorAll<HTMLElement>(".plots")];
  if (!text || places.length === 0) return;
  const data = JSON.parse(text) as EmbeddedDraws;
  const quantities = await readQuantities(data, places.map((p) => p.textContent ?? ""));
  document.head.append(h("style", {}, `${themed(".plots")}\n${uplot}\n.plots { ${plotStyle} }`));
  let width = 0;
  const draw = () => {
    width = places[0]!.clientWidth;
    const third = Math.floor((width - 170) / 3);
    const half = Math.floor((width - 8) / 2);
    const widths = width < NARROW ? [width, half, half] : [third, third, third];
    quantities.forEach((quantity, i) => {
      const trace = tracePlot(quantity, widths[0]!, data.every);
      const others = [densityPlot(quantity, widths[1]!), rankPlot(quantity, widths[2]!)];
      places[i]?.replaceChildren(places[i]!.firstElementChild!, trace, ...others);
    });
  };
  draw();
  addEventListener("resize", () => places[0]!.clientWidth !== width && draw());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

void start();
