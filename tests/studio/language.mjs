// Writing programs: diagnostics, completion, formatting, and an error that Apply explains.

import { check, ready, until } from "./look.mjs";

/** What the editor does while a program is written. */
export async function language({ open, step }) {
  const { page } = await open();
  await ready(page);
  const text = () => page.locator(".cm-content").innerText();
  const typeAtEnd = async (line) => {
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+End");
    await page.keyboard.type(`\n${line}`);
  };

  await step("a mistake is marked while typing", async () => {
    await typeAtEnd("let q = viu;");
    await page.locator(".cm-lintRange-error").first().waitFor();
    await page.locator(".cm-lintRange-error").first().hover();
    await page.locator(".cm-tooltip", { hasText: "viu" }).waitFor();
  });

  await step("Apply tells the mistake, and the session stays", async () => {
    await page.keyboard.press("Control+Enter");
    await page.locator(".program .error-box", { hasText: "viu" }).waitFor();
    check(await page.getByRole("button", { name: "Apply" }).isEnabled(), "the text was applied");
  });

  await step("names are completed", async () => {
    await page.keyboard.press("Escape");
    for (let i = 0; i < "viu;".length; i++) await page.keyboard.press("Backspace");
    await page.keyboard.type("scene.bou");
    await page.locator(".cm-tooltip-autocomplete", { hasText: "scene.bounds" }).waitFor();
    // Enter right after the list appears would still be a line break.
    await page.waitForTimeout(300);
    await page.keyboard.press("Enter");
    await until(async () => (await text()).includes("scene.bounds"), "nothing was completed");
  });

  await step("the program is formatted", async () => {
    await page.keyboard.press("Control+End");
    const tail = (await text()).trimEnd().endsWith(")") ? "" : "(view)";
    await page.keyboard.type(`${tail};`);
    await typeAtEnd("let   z=1+2;");
    await page.getByRole("button", { name: "Format" }).click();
    await until(async () => (await text()).includes("let z = 1 + 2;"), "it is as it was");
  });
}
