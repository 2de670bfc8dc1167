// How the page looks: wide and narrow, light and dark, against golden images. What differs from
// run to run or with the machine's graphics is masked.

import { checkGolden } from "./golden.mjs";
import { ready } from "./look.mjs";

const SIZES = [
  [1400, 900],
  [800, 1000],
];

/** Takes the screenshots. */
export async function appearance({ open, step, out, update }) {
  for (const [width, height] of SIZES) {
    for (const dark of [false, true]) {
      const name = `start-${width}x${height}-${dark ? "dark" : "light"}`;
      await step(`the page at ${width} x ${height}, ${dark ? "dark" : "light"}`, async () => {
        const { page } = await open({ width, height, dark });
        await ready(page);
        await page.locator('[role="treeitem"]').first().waitFor();
        const mask = [page.locator(".picture"), page.locator(".space canvas")];
        const shot = await page.screenshot({ mask, maskColor: "#808080", caret: "hide" });
        const fraction = checkGolden(name, shot, { out, update });
        await page.context().close();
        return `${(100 * fraction).toFixed(2)}% differ`;
      });
    }
  }
}
