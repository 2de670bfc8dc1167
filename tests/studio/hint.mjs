// Pointing out the object in the photograph: by a box, with keys, and for a run.

import { join } from "node:path";
import { check, ready, shownErrors, until } from "./look.mjs";

/** The cup in `coffee_cup.png`: left, top, width and height. */
const CUP = [92, 9, 127, 144];

/** Goes through the tools. */
export async function hint({ open, step, out }) {
  const { page } = await open();
  const press = (name) => page.getByRole("button", { name, exact: true }).click();
  const said = () => page.locator(".hint-bar output").innerText();
  await ready(page);
  await page.getByLabel("Photograph", { exact: true }).selectOption("images/coffee_cup.png");
  await page.locator('.hint-layer[viewBox="0 0 320 213"]').waitFor();

  await step("a box is drawn around the cup, and its outline appears", async () => {
    await press("Box");
    const [from, to] = await onPage(page, [CUP.slice(0, 2), [CUP[0] + CUP[2], CUP[1] + CUP[3]]]);
    await page.mouse.move(...from);
    await page.mouse.down();
    await page.mouse.move((from[0] + to[0]) / 2, (from[1] + to[1]) / 2);
    await page.mouse.move(...to, { steps: 4 });
    await page.mouse.up();
    const outline = page.locator(".hint-layer .guess:not(.rough)");
    await outline.waitFor();
    check((await said()) === "box", `the page says \`${await said()}\``);
    const box = await outline.evaluate((path) => {
      const { x, y, width, height } = path.getBBox();
      return [x, y, width, height];
    });
    const near = box.every((x, i) => Math.abs(x - CUP[i]) < 25);
    check(near, `the outline is within ${box.map(Math.round)}, not about ${CUP}`);
    await page.screenshot({ path: join(out, "hint-box.png") });
  });

  await step("keys press where the cross is, and Escape leaves the tool", async () => {
    await press("Point");
    const layer = page.locator(".hint-layer");
    await layer.focus();
    for (const key of ["ArrowDown", "ArrowLeft", "Space"]) await page.keyboard.press(key);
    await page.locator(".hint-layer .on").waitFor();
    await page.keyboard.press("Delete");
    await page.locator(".hint-layer .on").waitFor({ state: "detached" });
    await page.keyboard.press("Escape");
    const tool = page.getByRole("button", { name: "Point", exact: true });
    check((await tool.getAttribute("aria-pressed")) === "false", "the tool is still chosen");
  });

  await step("a run has the box, for the command line too", async () => {
    await page.getByRole("button", { name: "Settings" }).click();
    await page.locator('input[name="time"]').fill("3");
    await page.keyboard.press("Escape");
    await press("Start");
    await until(
      async () => (await page.locator(".status .state").innerText()) === "done",
      "the run does not end",
      90,
    );
    const found = await page.locator(".top-bar .found").innerText();
    const whole = /^(found|perhaps found|not found): the object covers \d+% of the outlines/;
    check(whole.test(found), `it says of the object: ${found}`);
    await page.screenshot({ path: join(out, "hint-found.png") });
    await page.getByRole("tab", { name: "Runs" }).click();
    const command = await page.locator(".run-about pre.answer").innerText();
    const given = command.match(/--box '?([\d.,]+)/)?.[1]?.split(",").map(Number) ?? [];
    const same = given.length === 4 && given.every((x, i) => Math.abs(x - CUP[i]) < 2);
    check(same && !command.includes("--at"), `the command is ${command}`);
    return command;
  });

  await step("another photograph forgets the hint", async () => {
    await press("Session");
    await page.locator(".hint-layer .guess").waitFor();
    const other = page.getByLabel("Photograph", { exact: true });
    await other.selectOption("images/table_lamp.png");
    await page.locator(".hint-layer .guess").waitFor({ state: "detached" });
    const clear = page.getByRole("button", { name: "Clear", exact: true });
    check(await clear.isDisabled(), "there is something to clear");
    const errors = await shownErrors(page);
    check(errors.length === 0, `the page shows: ${errors.join("; ")}`);
    await page.context().close();
  });
}

/** Where positions in the photograph are on the page. */
export async function onPage(page, positions) {
  return page.locator(".hint-layer").evaluate((svg, all) => {
    const matrix = svg.getScreenCTM();
    return all.map(([x, y]) => {
      const at = new DOMPoint(x, y).matrixTransform(matrix);
      return [at.x, at.y];
    });
  }, positions);
}
