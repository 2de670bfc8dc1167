// Bundles the studio's page and the viewer of reports into dist/, and what notebooks need into the
// Python package. The bundles are checked in, so that nothing else needs Node. The same input
// gives the same bytes: CI compares.

import { build } from "esbuild";
import { mkdir, readFile, readdir, rm, writeFile, copyFile } from "node:fs/promises";
import { join } from "node:path";

const dist = "dist";
const notebook = "../python/src/pcadlang/notebook";

const common = {
  bundle: true,
  minify: true,
  sourcemap: false,
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  metafile: true,
  logLevel: "warning",
};

/** The folder in node_modules that holds a bundled file, or null for our own files. */
function packageFolder(input) {
  const match = input.match(/^(.*node_modules\/(?:@[^/]+\/)?[^/]+)\//);
  return match ? match[1] : null;
}

/** The licence texts of all packages from which the bundles took a file. */
async function licences(metafiles) {
  const folders = new Set();
  for (const metafile of metafiles) {
    for (const output of Object.values(metafile.outputs)) {
      for (const [input, { bytesInOutput }] of Object.entries(output.inputs)) {
        const folder = packageFolder(input);
        if (folder && bytesInOutput > 0) folders.add(folder);
      }
    }
  }
  const parts = [];
  for (const folder of [...folders].sort()) {
    const about = JSON.parse(await readFile(join(folder, "package.json"), "utf8"));
    const names = (await readdir(folder)).filter((n) => /^(licen[cs]e|copying)/i.test(n)).sort();
    if (names.length === 0) throw new Error(`${folder} has no licence text`);
    const texts = await Promise.all(names.map((n) => readFile(join(folder, n), "utf8")));
    const title = `${about.name} ${about.version} (${about.license})`;
    parts.push(`${title}\n${"=".repeat(title.length)}\n\n${texts.join("\n\n").trim()}\n`);
  }
  return parts.join("\n\n").replace(/\r\n/g, "\n");
}

// What is one file brings its style along as text, and its licence as a comment.
const alone = { loader: { ".css": "text" }, legalComments: "inline" };
await rm(dist, { recursive: true, force: true });
await mkdir(dist, { recursive: true });
const bundles = [
  { format: "esm", entryPoints: { studio: "src/main.ts" }, outdir: dist },
  { ...alone, format: "iife", entryPoints: { report: "src/report.ts" }, outdir: dist },
  { ...alone, format: "iife", entryPoints: { plots: "src/report_plots.ts" }, outdir: dist },
  { ...alone, format: "esm", entryPoints: { widget: "src/notebook.ts" }, outdir: notebook },
  { ...alone, format: "iife", entryPoints: { cells: "src/cells.ts" }, outdir: notebook },
];
const metafiles = [];
for (const bundle of bundles) metafiles.push((await build({ ...common, ...bundle })).metafile);
await copyFile(join("src", "index.html"), join(dist, "index.html"));
await writeFile(join(dist, "licences.txt"), await licences(metafiles));
const built = (await readdir(dist)).sort().map((name) => join(dist, name));
for (const file of [...built, join(notebook, "widget.js"), join(notebook, "cells.js")]) {
  const { length } = await readFile(file);
  console.log(`${file}: ${(length / 1024).toFixed(0)} KiB`);
}
