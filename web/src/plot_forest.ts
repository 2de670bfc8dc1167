// A forest plot: the 50% and 90% intervals of quantities below each other.

import { canvas, themeColour, ticks } from "./canvas";
import { h, number } from "./dom";
import type { Interval } from "./plot_data";

const ROW = 20;

// Intervals that differ more in length than this would be points on a common axis.
const MOST_RATIO = 20;

/** The intervals of quantities, on one axis, or on one each where their scales differ. */
export function forestPlot(intervals: Interval[], width: number): HTMLElement {
  const low = Math.min(...intervals.map((i) => i.outer[0]));
  const high = Math.max(...intervals.map((i) => i.outer[1]));
  const lengths = intervals.map((i) => i.outer[1] - i.outer[0]).filter((l) => l > 0);
  const common = (high - low) / Math.min(...lengths) < MOST_RATIO;
  const left = Math.min(150, 0.3 * width);
  const right = width - 130;
  const along = (v: number, from: number, to: number) => {
    return left + ((v - from) / (to - from || 1)) * (right - left);
  };
  const height = intervals.length * ROW + 26;
  const label = `Intervals of ${intervals.length} quantities`;
  const picture = canvas(width, height, label, (context) => {
    const line = (from: number, to: number, y: number, thick: number) => {
      context.lineWidth = thick;
      context.beginPath();
      context.moveTo(from, y);
      context.lineTo(to, y);
      context.stroke();
    };
    context.textBaseline = "middle";
    context.fillStyle = themeColour("muted");
    context.textAlign = "center";
    for (const tick of common ? ticks(low, high, 4) : []) {
      const x = along(tick, low, high);
      context.strokeStyle = themeColour("line");
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(x, 0);
      context.lineTo(x, height - 20);
      context.stroke();
      context.fillText(number(tick, 3), x, height - 9);
    }
    intervals.forEach(({ name, outer, inner, middle }, i) => {
      const y = (i + 0.5) * ROW;
      const x = (v: number) => (common ? along(v, low, high) : along(v, outer[0], outer[1]));
      context.fillStyle = themeColour("text");
      context.textAlign = "left";
      context.fillText(name, 2, y, left - 10);
      context.strokeStyle = themeColour("accent");
      line(x(outer[0]), x(outer[1]), y, 1.5);
      line(x(inner[0]), x(inner[1]), y, 4);
      context.fillStyle = themeColour("surface");
      context.beginPath();
      context.arc(x(middle), y, 3, 0, 2 * Math.PI);
      context.fill();
      context.lineWidth = 1.5;
      context.stroke();
      context.fillStyle = themeColour("muted");
      const [from, to] = outer;
      const text = `${number(middle, 3)} [${number(from, 3)}, ${number(to, 3)}]`;
      context.fillText(text, right + 8, y, 120);
    });
  });
  const axis = common ? "" : ", each on an axis of its own";
  const caption = h("figcaption", {}, `Median, 50% and 90% intervals${axis}`);
  return h("figure", { class: "plot" }, caption, picture);
}
