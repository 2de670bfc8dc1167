// The numbers behind the plots: ranks, bins, intervals.

import type { Quantity, Statistics } from "./protocol";

/** Ranks of all draws together, by chain, as fractions between 0 and 1; ties get their mean. */
export function ranks(chains: (number | null)[][]): number[][] {
  const all: { x: number; chain: number }[] = [];
  chains.forEach((draws, chain) => {
    for (const x of draws) if (x !== null) all.push({ x, chain });
  });
  all.sort((a, b) => a.x - b.x);
  const result: number[][] = chains.map(() => []);
  for (let i = 0; i < all.length; ) {
    let j = i;
    while (j < all.length && all[j]!.x === all[i]!.x) j++;
    const rank = (i + j) / 2 / all.length;
    for (; i < j; i++) result[all[i]!.chain]!.push(rank);
  }
  return result;
}

/** How many numbers fall into each of equal bins between two bounds. */
export function histogram(xs: number[], low: number, high: number, bins: number): number[] {
  const counts = new Array<number>(bins).fill(0);
  const width = high - low || 1;
  for (const x of xs) {
    const bin = Math.floor(((x - low) / width) * bins);
    if (bin >= 0 && bin <= bins) counts[Math.min(bin, bins - 1)]!++;
  }
  return counts;
}

/** The finite numbers of a quantity's chains. */
export function finite({ chains }: Quantity): number[] {
  return chains.flat().filter((x): x is number => x !== null && Number.isFinite(x));
}

/** The least and the largest of some numbers. */
export function range(xs: number[]): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (const x of xs) {
    if (x < low) low = x;
    if (x > high) high = x;
  }
  return low < high ? [low, high] : [low - 0.5, low + 0.5];
}

/** An inner and an outer interval around a middle. */
export interface Interval {
  name: string;
  outer: [number, number];
  inner: [number, number];
  middle: number;
}

/** The intervals of a quantity: 90% and 50%. */
export function interval(name: string, s: Statistics): Interval | null {
  const { mean, sd } = s;
  if (mean === null || mean === undefined || sd === null || sd === undefined) return null;
  // A normal distribution has half of its mass within 0.674 standard deviations.
  const half = 0.6745 * sd;
  return {
    name,
    outer: [s.q05 ?? mean - 1.645 * sd, s.q95 ?? mean + 1.645 * sd],
    inner: [s.q25 ?? mean - half, s.q75 ?? mean + half],
    middle: s.q50 ?? s.median ?? mean,
  };
}
