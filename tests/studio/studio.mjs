// The studio from end to end, as a user meets it: the real program, a real browser.
//
//     node studio.mjs BINARY [--out FOLDER] [--update] [--page FOLDER]
//
// `--update` replaces the golden images, `--page` takes another page and viewer than the binary's own.

import { mkdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { parseArgs } from "node:util";
import { openPage, startBrowser } from "./browser.mjs";
import { startProgram } from "./program.mjs";
import { appearance } from "./appearance.mjs";
import { first } from "./first.mjs";
import { hint } from "./hint.mjs";
import { keyboard } from "./keyboard.mjs";
import { language } from "./language.mjs";
import { scenario } from "./scenario.mjs";
import { standalone } from "./standalone.mjs";

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    out: { type: "string", default: "target/studio-test" },
    update: { type: "boolean", default: false },
    page: { type: "string" },
  },
});
const binary = positionals[0] ?? process.env.PCADLANG;
if (!binary) {
  console.error("usage: node studio.mjs BINARY [--out FOLDER] [--update] [--page FOLDER]");
  process.exit(2);
}
const out = resolve(values.out);
mkdirSync(out, { recursive: true });

const program = await startProgram(
  resolve(binary),
  "lathe.pcad",
  "--observe",
  "images/coffee_cup.png",
);
const browser = await startBrowser();
const opened = [];

/** Opens the program's page in a window of its own. */
async function open(options = {}) {
  const size = { width: 1400, height: 900, ...options };
  const before = values.page ? (context) => servePage(context, values.page) : undefined;
  const address = options.address ?? program.address;
  const result = await openPage(browser, address, size, before);
  opened.push(result);
  return result;
}

/** Answers requests for the page with the files of a folder. */
async function servePage(context, folder) {
  const types = { "index.html": "text/html", "studio.js": "text/javascript" };
  for (const name of ["index.html", "studio.js", "studio.css"]) {
    const path = name === "index.html" ? "/" : `/${name}`;
    await context.route((url) => url.pathname === path, async (route) => {
      const response = await route.fetch();
      const headers = { ...response.headers(), "content-type": types[name] ?? "text/css" };
      const body = readFileSync(join(folder, name), "utf8");
      await route.fulfill({ response, headers, body, status: 200 });
    });
  }
}

let failed = 0;

/** Runs one step; a failure is told with its page's picture, and ends the test. */
async function step(name, task) {
  const begun = performance.now();
  try {
    const note = await task();
    const seconds = ((performance.now() - begun) / 1000).toFixed(1);
    console.log(`ok    ${name} (${seconds} s)${note ? `: ${note}` : ""}`);
  } catch (error) {
    failed++;
    console.error(`FAIL  ${name}: ${error.message}`);
    for (const [i, { page }] of opened.entries()) {
      await page.screenshot({ path: join(out, `failure-${i + 1}.png`) }).catch(() => {});
    }
    throw error;
  }
}

try {
  const tools = { open, step, out, update: values.update, program, viewer: values.page };
  await first({ ...tools, start: () => startProgram(resolve(binary)) });
  await appearance(tools);
  await scenario(tools);
  await language(tools);
  await keyboard(tools);
  await hint(tools);
  await standalone(tools);
  await step("no page reported an error", async () => {
    const errors = opened.flatMap(({ errors }) => errors);
    if (errors.length > 0) throw new Error(errors.join("\n"));
  });
  console.log(`all steps passed; screenshots are in ${out}`);
} catch (error) {
  if (failed === 0) console.error(error);
  console.error(`the program said:\n${program.said()}`);
  process.exitCode = 1;
} finally {
  await browser.close();
  await program.end();
}
