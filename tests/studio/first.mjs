// The first ten minutes: from an empty folder and no arguments to runs of a person, an object, and
// a program of one's own; on a large page, then on a telephone.

import { join } from "node:path";
import { onPage } from "./hint.mjs";
import { check, place, ready, settled, shownErrors, until } from "./look.mjs";

const FLAG = /(^|\s)--[a-z]/;

/** Goes through them with a program of its own. */
export async function first({ open, step, out, start }) {
  const program = await start();
  try {
    const { page } = await open({ address: program.address, width: 1440 });
    await alone({ page, step, out });
    await together({ page, step, open, program });
    const phone = await open({ address: program.address, width: 390, height: 844 });
    await small({ page: phone.page, step, out });
    // A page whose program is gone would report that.
    for (const opened of [page, phone.page]) await opened.context().close();
  } finally {
    await program.end();
  }
}

const press = (page, name) => page.getByRole("button", { name, exact: true }).first().click();
const photo = (page) => page.getByLabel("Photograph", { exact: true });
const chooser = (page) => page.getByLabel("Program", { exact: true }).first();
const quality = (page) => page.getByLabel("Quality").locator("option").first().innerText();

/** Waits until the run that is looked at has ended. */
async function ended(page) {
  await page.locator(".status .state.done").waitFor({ timeout: 120_000 });
}

/** Nothing that the page shows names an option that nobody typed. */
async function speaksOfThePage(page) {
  for (const text of [...(await shownErrors(page)), ...(await page.locator(".found p").allInnerTexts())]) {
    check(!FLAG.test(text), `the page speaks of the command line: ${text}`);
  }
}

async function alone({ page, step, out }) {
  const shot = (name) => page.screenshot({ path: join(out, `first-${name}.png`) });

  await step("Start without a program says what to choose", async () => {
    await page.getByRole("heading", { name: "Choose a program" }).waitFor();
    await press(page, "Start");
    await page.locator(".error-box", { hasText: "no program" }).waitFor();
    await shot("empty");
  });

  await step("a program that needs a photograph asks for it", async () => {
    await page.getByRole("button", { name: /^human\.pcad/ }).click();
    await page.locator(".ask", { hasText: "needs a photograph" }).waitFor();
    await press(page, "Start");
    await page.locator(".error-box", { hasText: "human.pcad needs a photograph" }).waitFor();
    await speaksOfThePage(page);
    await shot("asks");
  });

  await step("an example photograph is one click, and the state is a draw", async () => {
    await page.locator(".ask").getByRole("button", { name: "Example: skier.jpg" }).click();
    await ready(page);
    check((await photo(page).inputValue()) === "pictures/skier.jpg", "the example is not chosen");
    await page.locator(".note-bar", { hasText: "A draw from the prior: press Start" }).waitFor();
    check((await shownErrors(page)).length === 0, "an old error stays");
  });

  await step("Start runs `fast`, and next would run `accurate`", async () => {
    check((await quality(page)).startsWith("fast"), "the first preset is not fast");
    await press(page, "Start");
    await ended(page);
    check((await quality(page)).startsWith("now accurate"), "the next preset is not accurate");
    const options = await page.getByLabel("Quality").locator("option").allInnerTexts();
    check(options.includes("the program's own time"), "the program's own time is no choice");
    await page.locator(".found summary").waitFor();
    await speaksOfThePage(page);
    await shot("person");
  });

  await step("another program keeps the photograph and nothing of the run", async () => {
    await chooser(page).selectOption("lathe.pcad");
    await until(() => place(page).run === undefined, "the old run is still looked at");
    await page.locator(".note-bar", { hasText: "A draw from the prior" }).waitFor();
    check((await photo(page).inputValue()) === "pictures/skier.jpg", "the photograph is lost");
    check(await page.getByRole("button", { name: "Ghosts" }).isDisabled(), "ghosts are left");
    check(await page.locator(".found").isHidden(), "the old verdict is left");
  });

  await step("no photograph is a choice, and the page asks for one", async () => {
    await photo(page).selectOption({ label: "No photograph" });
    const ask = page.locator(".note-bar").getByRole("button", { name: "Example: coffee_cup.png" });
    await ask.waitFor();
    await press(page, "Start");
    await page.locator(".error-box", { hasText: "`photo` is missing" }).waitFor();
    await speaksOfThePage(page);
    await ask.click();
    await until(
      async () => (await photo(page).inputValue()) === "pictures/coffee_cup.png",
      "the example is not chosen",
    );
    await settled(page, ".viewer .picture");
  });

  await step("the object is pointed out with a box, and found or not is said", async () => {
    await press(page, "Box");
    const [from, to] = await onPage(page, [[92, 9], [219, 153]]);
    await page.mouse.move(...from);
    await page.mouse.down();
    await page.mouse.move(...to, { steps: 6 });
    await page.mouse.up();
    await page.locator(".hint-layer .guess").first().waitFor();
    await press(page, "Box");
    await press(page, "Start");
    await ended(page);
    await page.locator(".found p").waitFor();
    await speaksOfThePage(page);
    await shot("cup");
    return page.locator(".found p").innerText();
  });

  await step("another photograph leaves nothing of the run", async () => {
    await photo(page).selectOption("pictures/skier.jpg");
    await until(() => place(page).run === undefined, "the old run is still looked at");
    await page.locator(".found").waitFor({ state: "hidden" });
    check((await page.locator(".status").innerText()) === "No run yet", "the old status is left");
  });

  await step("a new program without data works beside a photograph", async () => {
    await chooser(page).selectOption({ label: "New program" });
    await until(async () => (await chooser(page).inputValue()) === "new.pcad", "it is not opened");
    await press(page, "Start");
    await ended(page);
    await page.locator(".plot canvas").first().waitFor();
    const width = (await page.locator(".plots").boundingBox()).width;
    check(width > 900, `the plots have ${width} pixels`);
    check(await page.locator(".panes").isHidden(), "an empty scene takes room");
    await shot("own-program");
  });

  await step("after ~ distributions are offered first", async () => {
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+End");
    await page.keyboard.type("assume q ~ norm");
    const words = page.locator(".cm-tooltip-autocomplete li .cm-completionLabel");
    await words.first().waitFor();
    check((await words.first().innerText()) === "normal", await words.first().innerText());
    await page.keyboard.press("Escape");
  });

  await step("Start refuses a mistake, and then runs what is on screen", async () => {
    const runs = () => page.getByRole("tab", { name: "Runs" }).click();
    await page.keyboard.type("l(0, 1);");
    await press(page, "Start");
    await page.locator(".error-box", { hasText: "did you mean `normal`" }).waitFor();
    await page.locator(".cm-lintRange-error").first().waitFor();
    await runs();
    check((await page.locator("#panel-runs tbody tr").count()) === 3, "a run was begun");
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+End");
    for (let i = 0; i < "l(0, 1);".length; i++) await page.keyboard.press("Backspace");
    await page.keyboard.type("al(0, 1);");
    await page.keyboard.press("Escape");
    await press(page, "Start");
    await until(async () => (await page.locator("#panel-runs tbody tr").count()) === 4, "no run");
    await ended(page);
    await page.getByRole("tab", { name: "Plots" }).click();
    await page.locator(".quantities", { hasText: "q" }).waitFor();
  });

  await step("a program that takes a photograph gets the one at hand", async () => {
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+a");
    await page.keyboard.insertText(
      'include "std/scene.pcad" as scene;\ndata photo: image "it";\n' +
        "assume r ~ uniform(0.2, 1);\nlet view = scene.render(scene.sphere(r));\n" +
        "observe normal(r, 0.1) = photo.width / 1000 as seen;\n",
    );
    await page.keyboard.press("Escape");
    await page.keyboard.press("Control+Enter");
    await ready(page);
    await page.getByLabel("Layer").first().selectOption("overlay");
    check((await shownErrors(page)).length === 0, (await shownErrors(page)).join());
  });

  await step("a dropped program is opened; another file is refused", async () => {
    const drop = (name, type, text) =>
      page.evaluate(([name, type, text]) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([text], name, { type }));
        document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
      }, [name, type, text]);
    await drop("dropped.pcad", "", "assume x ~ flip(0.5);\nobserve normal(0, 1) = 1 as y;\n");
    await until(async () => (await chooser(page).inputValue()) === "dropped.pcad", "it is not opened");
    await drop("notes.txt", "text/plain", "no");
    await page.locator(".error-box", { hasText: "neither a photograph nor a program" }).waitFor();
    await page.locator(".error-box .close").first().click();
  });

  await step("? explains the page", async () => {
    await press(page, "Help");
    await page.locator("dialog", { hasText: "From a program and a photograph" }).waitFor();
    await shot("help");
    await press(page, "Close");
  });

  await step("Compare and Runs fit", async () => {
    for (const name of ["Compare", "Runs"]) {
      await page.getByRole("tab", { name }).click();
      const panel = page.locator(`#panel-${name.toLowerCase()} .scroll`);
      const over = await panel.evaluate((e) => e.scrollWidth - e.clientWidth);
      check(over <= 0, `${name} is ${over} pixels too wide`);
    }
  });
}

async function together({ page, step, open, program }) {
  await step("two tabs hear of each other", async () => {
    const { page: other } = await open({ address: program.address, width: 1440 });
    await until(async () => (await chooser(other).inputValue()) === "dropped.pcad", "not the same");
    await press(page, "Start");
    await other.locator(".told", { hasText: "Another tab started" }).waitFor();
    await ended(other);
    await chooser(page).selectOption("coin.pcad");
    await until(async () => (await chooser(other).inputValue()) === "coin.pcad", "not followed");
    await other.locator(".told", { hasText: "Another tab opened coin.pcad" }).waitFor();
    check(await page.locator(".told").isHidden(), "a tab hears of itself");
    await other.context().close();
  });
}

async function small({ page, step, out }) {
  await step("a telephone has one column", async () => {
    await chooser(page).selectOption("lathe.pcad");
    await ready(page);
    const boxes = [];
    for (const selector of [".top-bar", ".viewer .picture", ".space", ".tabs"]) {
      boxes.push([selector, await page.locator(selector).first().boundingBox()]);
    }
    for (const [i, [name, box]] of boxes.entries()) {
      check(box.x >= 0 && box.x + box.width <= 391, `${name} leaves the page`);
      const above = boxes[i - 1]?.[1];
      check(!above || box.y >= above.y + above.height - 1, `${name} lies over what is above it`);
    }
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    check(over <= 0, `the page is ${over} pixels too wide`);
    await page.screenshot({ path: join(out, "first-telephone.png"), fullPage: true });
  });
}
