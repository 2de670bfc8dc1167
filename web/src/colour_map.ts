// The colours of parts, chains and uncertainty.

/** Red, green and blue, from 0 to 255. */
export type Rgb = [number, number, number];

// Viridis at eleven equally spaced places: perceptually uniform, and readable by the colour-blind.
const VIRIDIS: Rgb[] = [
  [68, 1, 84],
  [72, 36, 117],
  [65, 68, 135],
  [53, 95, 141],
  [42, 120, 142],
  [33, 145, 140],
  [34, 168, 132],
  [68, 191, 112],
  [122, 209, 81],
  [189, 223, 38],
  [253, 231, 37],
];

/** The colour of a fraction between 0 and 1, as numbers between 0 and 255. */
export function viridis(fraction: number): Rgb {
  const x = Math.min(1, Math.max(0, fraction || 0)) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(x), VIRIDIS.length - 2);
  const t = x - i;
  return VIRIDIS[i]!.map((c, k) => c + t * (VIRIDIS[i + 1]![k]! - c)) as Rgb;
}

/** The colour map as a CSS gradient from left to right. */
export function viridisGradient(): string {
  return `linear-gradient(to right, ${VIRIDIS.map((c) => `rgb(${c.join(",")})`).join(",")})`;
}

// Okabe and Ito's colours, told apart by the colour-blind.
const DISTINCT = [
  "#0072b2",
  "#e69f00",
  "#009e73",
  "#cc79a7",
  "#56b4e9",
  "#d55e00",
  "#8a8a1f",
  "#7f6bb8",
];

/** The colour of a chain. */
export function chainColour(chain: number): string {
  return DISTINCT[chain % DISTINCT.length]!;
}

/** The colour of a part of a scene: golden-angle hues, so that neighbours differ. */
export function partColour(part: number): Rgb {
  const hue = (part * 137.508 + 25) % 360;
  const [s, l] = [0.5, part % 2 ? 0.52 : 0.64];
  const f = (n: number) => {
    const k = (n + hue / 30) % 12;
    return 255 * (l - s * Math.min(l, 1 - l) * Math.max(-1, Math.min(k - 3, 9 - k, 1)));
  };
  return [f(0), f(8), f(4)];
}
