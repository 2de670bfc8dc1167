// The main controls without a pointer.

import { check, ready, settled, pixels, checkChanged, until } from "./look.mjs";

/** Tab reaches the controls, and keys work them. */
export async function keyboard({ open, step }) {
  const { page } = await open();
  await ready(page);
  const focused = () =>
    page.evaluate(() => {
      const element = document.activeElement;
      return element?.getAttribute("aria-label") ?? element?.textContent?.trim() ?? "";
    });

  await step("Tab reaches program, photograph, Start and Settings in order", async () => {
    const wanted = ["Program", "Photograph", "Start", "Settings"];
    const reached = [];
    for (let i = 0; i < 12 && reached.length < wanted.length; i++) {
      await page.keyboard.press("Tab");
      const name = await focused();
      if (name === wanted[reached.length]) reached.push(name);
    }
    check(reached.length === wanted.length, `only reached ${reached.join(", ")}`);
  });

  await step("Escape closes the settings and returns to their button", async () => {
    await page.keyboard.press("Enter");
    await page.locator("#settings").waitFor({ state: "visible" });
    await page.keyboard.press("Escape");
    await page.locator("#settings").waitFor({ state: "hidden" });
    check((await focused()) === "Settings", `the focus is on ${await focused()}`);
  });

  await step("arrow keys move between tabs", async () => {
    await page.getByRole("tab", { name: "Trace" }).focus();
    await page.keyboard.press("ArrowRight");
    check((await focused()) === "Plots", `the focus is on ${await focused()}`);
    await page.keyboard.press("ArrowLeft");
    check(await page.getByRole("tree").isVisible(), "the trace is not shown");
  });

  await step("arrow keys go through the trace and move a slider", async () => {
    await page.getByRole("tree").focus();
    await page.keyboard.press("Home");
    const name = await page.locator('[role="treeitem"][aria-selected="true"] .name').innerText();
    check(name.includes("@"), "no choice is selected");
    await page.keyboard.press("Enter");
    const joint = await page.locator(".joint b").innerText();
    const field = page.locator(".control input[type=range]").first();
    await field.focus();
    await page.keyboard.press("ArrowRight");
    await until(
      async () => (await page.locator(".joint b").innerText()) !== joint,
      "the slider does not change the choice",
    );
  });

  await step("arrow keys turn the 3D view", async () => {
    await settled(page, ".space");
    const before = await pixels(page, ".space");
    await page.locator(".space canvas").focus();
    for (let i = 0; i < 4; i++) await page.keyboard.press("ArrowRight");
    await settled(page, ".space");
    return checkChanged(before, await pixels(page, ".space"), "the 3D view");
  });
}
