// What the tests ask of a page.

import { PNG } from "pngjs";
import { difference } from "./golden.mjs";

/** Fails with a message unless the condition holds. */
export function check(condition, message) {
  if (!condition) throw new Error(message);
}

/** Waits until a function's answer is true. */
export async function until(task, message, seconds = 30) {
  const end = performance.now() + 1000 * seconds;
  for (;;) {
    const answer = await task();
    if (answer) return answer;
    if (performance.now() > end) throw new Error(`after ${seconds} s: ${message}`);
    await new Promise((resolve) => setTimeout(resolve, 150));
  }
}

/** The part of the address after `#`, by name. */
export function place(page) {
  return Object.fromEntries(new URLSearchParams(new URL(page.url()).hash.slice(1)));
}

/** Waits until the viewer shows a picture and a mesh. */
export async function ready(page) {
  await page.locator(".viewer .picture img").waitFor({ state: "visible" });
  await page.locator(".space canvas").waitFor({ state: "visible" });
  await settled(page, ".viewer .panes");
}

/** A part of the page as an image. */
export async function pixels(page, selector) {
  return PNG.sync.read(await page.locator(selector).first().screenshot());
}

/** Waits until a part of the page no longer changes. */
export async function settled(page, selector, seconds = 20) {
  let before = await pixels(page, selector);
  await until(async () => {
    await page.waitForTimeout(500);
    const now = await pixels(page, selector);
    const same = difference(before, now) === 0;
    before = now;
    return same;
  }, `${selector} does not come to rest`, seconds);
}

/** Fails unless two images differ in more than a fraction of their pixels. */
export function checkChanged(before, after, what, fraction = 0.002) {
  const changed = difference(before, after);
  check(changed > fraction, `${what}: only ${(100 * changed).toFixed(2)}% of the pixels changed`);
  return `${(100 * changed).toFixed(1)}% of the pixels changed`;
}

/** The log joint that a part of the page tells (the status: that of the best state), or null. */
export async function logJoint(page, selector) {
  const text = await page.locator(selector).innerText();
  const match = text.replaceAll("\u2212", "-").match(/log joint (-?[\d.]+)/);
  return match ? Number(match[1]) : null;
}

/** Whatever errors the page shows. */
export async function shownErrors(page) {
  return page.locator(".error-box:visible").allInnerTexts();
}
