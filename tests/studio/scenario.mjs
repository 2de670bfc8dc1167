// One session with a person's photograph, from opening it to comparing two runs.

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { onPage } from "./hint.mjs";
import {
  check,
  checkChanged,
  logJoint,
  pixels,
  place,
  ready,
  settled,
  shownErrors,
  until,
} from "./look.mjs";

const PICTURE = ".viewer .picture";

/** Goes through the session. */
export async function scenario({ open, step, out, program }) {
  const { page } = await open();
  const shot = (name) => page.screenshot({ path: join(out, `${name}.png`) });
  const press = (name) => page.getByRole("button", { name, exact: true }).click();
  const tab = (name) => page.getByRole("tab", { name }).click();
  await ready(page);

  await step("a photograph is stored and observed", async () => {
    const before = await pixels(page, PICTURE);
    const file = join(program.folder, "images", "skier.jpg");
    await page.locator('input[accept^="image"]').setInputFiles(file);
    const photo = page.getByLabel("Photograph", { exact: true });
    await until(
      async () => (await photo.inputValue()).startsWith("pictures/"),
      "the photograph is not the session's",
    );
    await settled(page, PICTURE);
    return checkChanged(before, await pixels(page, PICTURE), "the picture");
  });

  await step("a dropped photograph is observed", async () => {
    const data = readFileSync(join(program.folder, "images", "skier.jpg")).toString("base64");
    await page.evaluate(async (base64) => {
      const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([bytes], "dropped.jpg", { type: "image/jpeg" }));
      document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
    }, data);
    const photo = page.getByLabel("Photograph", { exact: true });
    await until(
      async () => (await photo.inputValue()) === "pictures/dropped.jpg",
      "the photograph is not the session's",
    );
  });

  await step("a program is opened with that photograph", async () => {
    await page.getByLabel("Program", { exact: true }).first().selectOption("human.pcad");
    await until(() => place(page).session === "2", "no second session", 90);
    await page.getByText("@cloth", { exact: true }).waitFor();
    await settled(page, PICTURE);
    await shot("human-prior");
  });

  await step("a click chooses the person", async () => {
    await press("Point");
    const [at] = await onPage(page, [[172, 190]]);
    await page.mouse.click(...at);
    await page.locator(".hint-layer .guess").waitFor();
    const said = await page.locator(".hint-bar output").innerText();
    check(said.startsWith("person"), `the page says \`${said}\``);
    await shot("human-click");
    await press("Clear");
    await page.locator(".hint-layer .guess").waitFor({ state: "detached" });
    await press("Point");
    await settled(page, PICTURE);
  });

  await step("a run improves the overlay", async () => {
    const before = await pixels(page, PICTURE);
    const prior = await logJoint(page, ".joint");
    await setTime(page, 40);
    await press("Start");
    // The start of a run may find its best state before the page asks for the first time.
    const better = await until(async () => {
      const now = await logJoint(page, ".status");
      return now !== null && now > prior ? now : null;
    }, `no state is better than the prior's (${prior})`, 60);
    await until(async () => {
      const now = await pixels(page, PICTURE);
      return checkChangedOrNull(before, now);
    }, "the overlay does not change");
    await shot("human-running");
    return `log joint ${prior} to ${better}`;
  });

  await step("a paused run stands still, and goes on", async () => {
    await press("Pause");
    await page.locator(".state.paused").waitFor();
    // Each chain finishes the step that it is in.
    await page.waitForTimeout(2500);
    const before = await page.locator(".status").innerText();
    await page.waitForTimeout(3000);
    const after = await page.locator(".status").innerText();
    check(before === after, `the status changed from \`${before}\` to \`${after}\``);
    await press("Go on");
    await page.locator(".state.running").waitFor();
    await until(
      async () => (await page.locator(".status").innerText()) !== after,
      "the time does not go on",
    );
  });

  await step("a reload in the middle of the run finds it as it was", async () => {
    await tab("Runs");
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+End");
    await page.keyboard.type("\n// a note");
    const before = place(page);
    await page.reload();
    await ready(page);
    await until(() => place(page).session === before.session, "the session is lost");
    const after = place(page);
    for (const name of ["session", "run", "view", "tab"]) {
      check(before[name] === after[name], `${name}: ${before[name]} became ${after[name]}`);
    }
    const chosen = await page.locator('[role="tab"][aria-selected="true"]').innerText();
    check(chosen === "Runs", `the tab is ${chosen}`);
    check(await page.getByRole("button", { name: "Apply" }).isEnabled(), "the edit is lost");
    check((await page.locator(".state.running").count()) > 0, "the run does not go on");
  });

  await step("the text is applied, and the session keeps its choices", async () => {
    await page.locator(".cm-content").click();
    await page.keyboard.press("Control+Enter");
    await until(
      async () => page.getByRole("button", { name: "Apply" }).isDisabled(),
      "the text is not applied",
      60,
    );
  });

  await step("the run ends with draws", async () => {
    await until(
      async () => (await page.locator(".status .state").innerText()) === "done",
      "the run does not end",
      90,
    );
    await press("Draws");
    await settled(page, ".viewer .panes");
    await shot("human-draws");
  });

  await step("the timeline leads from the best state through the draws", async () => {
    await press("Best");
    const timeline = page.locator(".timeline");
    await timeline.waitFor();
    check(await timeline.locator(".playhead").isHidden(), "the best state is none of the draws");
    const box = await timeline.boundingBox();
    const y = box.y + box.height - 3;
    // Scrubbed along the last chain, from its end to its beginning.
    await page.mouse.move(box.x + box.width - 1, y);
    await page.mouse.down();
    await until(() => place(page).view === "draws", "the draws are not shown");
    const last = Number(place(page).at);
    await settled(page, ".viewer .panes");
    const before = await pixels(page, PICTURE);
    const space = await pixels(page, ".space");
    await page.mouse.move(box.x + 2, y, { steps: 8 });
    await page.mouse.up();
    await until(() => Number(place(page).at) < last, "the first draw is not shown");
    const first = Number(place(page).at);
    const label = await page.locator(".frame-label").innerText();
    check(label.includes("draw 1"), `the label says ${label}`);
    await settled(page, ".viewer .panes");
    await shot("human-timeline");
    checkChanged(space, await pixels(page, ".space"), "the 3D view");
    const note = checkChanged(before, await pixels(page, PICTURE), "the picture");
    await page.keyboard.press("ArrowRight");
    check(Number(place(page).at) === first + 1, "the right key does not move by one state");
    await press("Draws");
    await page.keyboard.press("ArrowLeft");
    check(Number(place(page).at) === first, "the left key does not move back");
    return `${last - first + 1} draws; ${note}`;
  });

  await step("the scene turns, and returns to the camera", async () => {
    await press("From the camera");
    await settled(page, ".space");
    const before = await pixels(page, ".space");
    const box = await page.locator(".space canvas").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 20, { steps: 5 });
    await page.mouse.up();
    await settled(page, ".space");
    const note = checkChanged(before, await pixels(page, ".space"), "the 3D view");
    await press("From the camera");
    await settled(page, ".space");
    return note;
  });

  await step("ghosts and the uncertainty of the surface", async () => {
    const before = await pixels(page, ".space");
    await press("Ghosts");
    await page.getByLabel("Colours of the surface").selectOption("uncertainty");
    await page.getByText(/Standard deviation over \d+ draws/).waitFor({ timeout: 60_000 });
    await settled(page, ".space");
    await shot("human-uncertainty");
    return checkChanged(before, await pixels(page, ".space"), "the 3D view");
  });

  await step("the film plays from the prior to the posterior", async () => {
    await press("Film");
    const slider = page.locator(".timeline input[type=range]");
    await slider.fill("0");
    await settled(page, PICTURE);
    const before = await pixels(page, PICTURE);
    await page.getByRole("button", { name: "Play" }).click();
    await until(async () => Number(await slider.inputValue()) >= 3, "the film does not go on");
    await page.getByRole("button", { name: "Pause the film" }).click();
    await slider.fill((await slider.getAttribute("max")) ?? "0");
    await settled(page, PICTURE);
    return checkChanged(before, await pixels(page, PICTURE), "the picture");
  });

  await step("modes are pictures, and one is shown", async () => {
    await tab("Modes");
    const one = page.locator(".empty", { hasText: "All chains are in one mode" });
    await page.locator(".card img[src]").or(one).first().waitFor();
    if ((await one.count()) > 0) return "all chains are in one";
    await page.locator("button.card").first().click();
    await until(() => place(page).view === "modes", "the viewer shows no mode");
  });

  await step("plots of the run", async () => {
    await tab("Plots");
    await page.locator(".plot canvas").first().waitFor();
    for (const kind of ["Densities", "Ranks", "Pairs", "Intervals"]) {
      await press(kind);
      await page.locator(".plot canvas").first().waitFor();
    }
    await shot("human-plots");
  });

  await step("an arm is dragged, and the picture follows", async () => {
    await press("Edit");
    await until(() => place(page).session === "3", "no session at the run's best state", 60);
    await tab("Trace");
    await page.locator('[role="treeitem"]', { hasText: "@arm_l" }).first().click();
    // The fourth number of the arm's pose raises the upper arm.
    const slider = page.locator(".control input[type=range]").nth(3);
    await slider.waitFor();
    await settled(page, PICTURE);
    const before = await pixels(page, PICTURE);
    const joint = await page.locator(".joint b").innerText();
    const box = await slider.boundingBox();
    const y = box.y + box.height / 2;
    await page.mouse.move(box.x + box.width / 2, y);
    await page.mouse.down();
    for (let i = 1; i <= 12; i++) {
      await page.mouse.move(box.x + box.width * (0.5 + 0.03 * i), y);
      await page.waitForTimeout(40);
    }
    await page.mouse.up();
    await until(
      async () => (await page.locator(".joint b").innerText()) !== joint,
      "the log joint stays",
    );
    await settled(page, PICTURE);
    await shot("human-dragged");
    const note = checkChanged(before, await pixels(page, PICTURE), "the picture", 0.01);
    await press("Undo");
    await until(
      async () => (await page.locator(".joint b").innerText()) === joint,
      "undo does not restore the log joint of the time before the drag",
    );
    await settled(page, PICTURE);
    check(
      checkChangedOrNull(before, await pixels(page, PICTURE)) === null,
      "undo does not restore the picture",
    );
    return note;
  });

  await step("a limb is dragged over the photograph, and the picture follows", async () => {
    await press("Limbs");
    const joint = page.locator('.limb-layer [data-joint="l_wrist"]');
    const middle = async () => {
      const box = await joint.boundingBox();
      return [box.x + box.width / 2, box.y + box.height / 2];
    };
    await joint.waitFor();
    await settled(page, PICTURE);
    await shot("human-joints");
    const before = await pixels(page, PICTURE);
    const [x, y] = await middle();
    await page.mouse.move(x, y);
    await page.mouse.down();
    for (let i = 1; i <= 12; i++) {
      await page.mouse.move(x + 1.5 * i, y - 3 * i);
      await page.waitForTimeout(40);
    }
    await shot("human-pulling");
    await page.mouse.up();
    const near = async () => {
      const [u, v] = await middle();
      return Math.hypot(u - x - 18, v - y + 36) < 4;
    };
    await until(near, "the wrist is not where it was pulled");
    await settled(page, PICTURE);
    await shot("human-pulled");
    const note = checkChanged(before, await pixels(page, PICTURE), "the picture", 0.005);
    check((await shownErrors(page)).length === 0, (await shownErrors(page)).join());
    await joint.focus();
    const [, now] = await middle();
    await page.keyboard.press("Shift+ArrowDown");
    await until(async () => (await middle())[1] > now + 5, "a key does not pull");
    for (let i = 0; i < 2; i++) {
      const undone = await page.getByRole("button", { name: "Undo", exact: true }).getAttribute("title");
      check(undone === "Undo drag of l_wrist", `to be undone is ${undone}`);
      await press("Undo");
      await page.waitForTimeout(300);
    }
    await until(async () => Math.abs((await middle())[1] - y) < 1, "undo leaves the wrist there");
    await press("Limbs");
    await joint.waitFor({ state: "hidden" });
    return note;
  });

  await step("the prompt answers, and shows pictures", async () => {
    await tab("Prompt");
    const prompt = page.getByRole("textbox", { name: "Prompt" });
    await prompt.fill("1 + 1");
    await prompt.press("Enter");
    await page.locator(".output").getByText("2", { exact: true }).waitFor();
    await prompt.fill(":render");
    await prompt.press("Enter");
    await page.locator(".output img").waitFor();
    await prompt.fill("no_such_name");
    await prompt.press("Enter");
    await page.locator(".output .failed").waitFor();
    await shot("human-prompt");
  });

  await step("a second run is compared with the first", async () => {
    await setTime(page, 8);
    await press("Start");
    await until(
      async () => (await page.locator(".status .state").innerText()) === "done",
      "the second run does not end",
      90,
    );
    await tab("Compare");
    await page.locator(".compare tbody tr").nth(2).waitFor();
    await until(
      async () => (await page.locator(".compare .picture img:visible").count()) === 2,
      "two pictures are not shown",
    );
    await settled(page, ".compare");
    await shot("human-compare");
  });

  await step("nothing was left unexplained", async () => {
    const errors = await shownErrors(page);
    check(errors.length === 0, `the page shows: ${errors.join("; ")}`);
  });
}

async function setTime(page, seconds) {
  await page.getByRole("button", { name: "Settings" }).click();
  await page.locator('input[name="time"]').fill(String(seconds));
  await page.keyboard.press("Escape");
}

function checkChangedOrNull(before, after) {
  try {
    return checkChanged(before, after, "the picture", 0.01);
  } catch {
    return null;
  }
}
