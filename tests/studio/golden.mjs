// Compares screenshots with those kept in golden/, with a tolerance for fonts and edges.

import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { PNG } from "pngjs";

const golden = fileURLToPath(new URL("golden", import.meta.url));

// Other fonts shift glyphs by a pixel: pixels may differ a little everywhere, much only rarely.
const STEP = 48;
const FRACTION = 0.04;

/** The fraction of pixels of which a channel differs by more than the step. */
export function difference(a, b) {
  if (a.width !== b.width || a.height !== b.height) return 1;
  let count = 0;
  for (let i = 0; i < a.data.length; i += 4) {
    const far = [0, 1, 2].some((k) => Math.abs(a.data[i + k] - b.data[i + k]) > STEP);
    if (far) count++;
  }
  return count / (a.width * a.height);
}

/** Fails if a screenshot differs from its golden image; `update` replaces that instead. */
export function checkGolden(name, buffer, { out, update }) {
  writeFileSync(join(out, `${name}.png`), buffer);
  const file = join(golden, `${name}.png`);
  if (update || !existsSync(file)) {
    if (!update) throw new Error(`golden/${name}.png is missing: run with --update`);
    mkdirSync(dirname(file), { recursive: true });
    writeFileSync(file, buffer);
    return 0;
  }
  const fraction = difference(PNG.sync.read(buffer), PNG.sync.read(readFileSync(file)));
  if (fraction > FRACTION) {
    const percent = (100 * fraction).toFixed(1);
    throw new Error(`${name}: ${percent}% of the pixels differ from golden/${name}.png`);
  }
  return fraction;
}
