// The viewer outside the studio: in the report of a run, and in the output of a notebook's cell.

import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { check, checkChanged, pixels, settled } from "./look.mjs";

const SPACE = ".pcadlang-viewer .space";
const notebook = fileURLToPath(new URL("../../python/src/pcadlang/notebook", import.meta.url));

/** A cube as a kernel sends it: each face with corners of its own. */
function cube() {
  const faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  const vertices = faces.flat().flatMap((i) => [i & 1, (i >> 1) & 1, (i >> 2) & 1]);
  const triangles = faces.flatMap((_, f) => [0, 1, 2, 0, 2, 3].map((i) => 4 * f + i));
  return { vertices, triangles };
}

/** A page with the widget, whose model changes when `window.grow` is called. */
function cellPage() {
  const script = readFileSync(join(notebook, "widget.js"), "utf8").replaceAll("</", "<\\/");
  return `<!doctype html><meta charset="utf-8"><body><div id="cell"></div><script type="module">
    const source = new Blob([${JSON.stringify(script)}], { type: "text/javascript" });
    const { default: widget } = await import(URL.createObjectURL(source));
    const { vertices, triangles } = ${JSON.stringify(cube())};
    const data = (array) => new DataView(array.buffer);
    const values = {
      vertices: data(Float32Array.from(vertices)),
      triangles: data(Uint32Array.from(triangles)),
    };
    const listeners = {};
    const model = {
      get: (name) => values[name],
      on: (event, listener) => (listeners[event] = listener),
      off: (event) => delete listeners[event],
    };
    window.grow = () => {
      values.vertices = data(Float32Array.from(vertices, (x, i) => (i % 3 === 1 ? 2 * x : x)));
      listeners["change:vertices"]();
    };
    // A notebook puts the output into its page after it was drawn.
    const el = document.createElement("div");
    window.end = widget.render({ model, el });
    setTimeout(() => document.getElementById("cell").append(el), 100);
  </script>`;
}

/** Gives a report another viewer than that of the binary. */
function replaceViewer(file, script) {
  const [before, rest] = readFileSync(file, "utf8").split(/(?<=id="scene">.*<\/script>\n<script>)/);
  const after = rest.slice(rest.indexOf("</script>"));
  writeFileSync(file, before + script.replaceAll("</script", "<\\/script") + after);
}

/** Drags the 3D view sideways; the fraction of it that changed. */
async function turn(page) {
  await page.locator(`${SPACE} canvas`).waitFor({ state: "visible" });
  await settled(page, SPACE);
  const before = await pixels(page, SPACE);
  const box = await page.locator(`${SPACE} canvas`).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 90, y + 20, { steps: 5 });
  await page.mouse.up();
  await settled(page, SPACE);
  return checkChanged(before, await pixels(page, SPACE), "the 3D view");
}

/** Opens the pages: the report of the run that the scenario made, and cells. */
export async function standalone({ open, step, out, program, viewer }) {
  await step("the report of a run shows its draws", async () => {
    const runs = join(program.folder, "runs");
    const [run] = readdirSync(runs).filter((name) => name.startsWith("human"));
    const file = join(runs, run, "report.html");
    if (viewer) replaceViewer(file, readFileSync(join(viewer, "report.js"), "utf8"));
    const { page } = await open({ address: pathToFileURL(file).href });
    await page.locator("#viewer").scrollIntoViewIfNeeded();
    const note = await turn(page);
    const slider = page.locator(".timeline input[type=range]");
    const before = await pixels(page, SPACE);
    await slider.fill((await slider.getAttribute("max")) ?? "0");
    await settled(page, SPACE);
    checkChanged(before, await pixels(page, SPACE), "the draw");
    await page.screenshot({ path: join(out, "report.png") });
    const names = await page.locator(".plots").count();
    const plots = await page.locator(".plots .plot canvas").count();
    check(names > 0 && plots === 3 * names, `${plots} plots of ${names} quantities`);
    return note;
  });

  await step("a solid in a notebook turns, and follows its model", async () => {
    const { page } = await open({ address: "about:blank" });
    await page.setContent(cellPage());
    const note = await turn(page);
    const before = await pixels(page, SPACE);
    await page.evaluate(() => window.grow());
    await settled(page, SPACE);
    checkChanged(before, await pixels(page, SPACE), "the solid");
    await page.screenshot({ path: join(out, "notebook.png") });
    check((await page.locator(".viewer-head:visible").count()) === 0, "an empty row is shown");
    await page.evaluate(() => window.end());
    return note;
  });

  await step("cells of programs are painted", async () => {
    const { page } = await open({ address: "about:blank" });
    const lines = ["%%pcad line", "assume m ~ normal(0, 1);"].map(
      (text) => `<div class="cm-line">${text}</div>`,
    );
    await page.setContent(`<div class="cm-content">${lines.join("")}</div>`);
    await page.addScriptTag({ path: join(notebook, "cells.js") });
    const painted = await page.waitForFunction(() => {
      const of = (kind) => [...(CSS.highlights.get(`pcad-${kind}`) ?? [])].map(String);
      return of("keyword").length > 0 && [of("keyword"), of("function"), of("number")];
    });
    const found = JSON.stringify(await painted.jsonValue());
    check(found === '[["assume"],["normal"],["0","1"]]', `painted were ${found}`);
  });
}
