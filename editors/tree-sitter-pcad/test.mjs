// Parses every program of the repository, and fails if a program has a mistake that
// `programs/errors/parse` does not show on purpose, or if such a mistake is not seen.
//
//     node test.mjs            (tree-sitter from `npm install`, or any other in the PATH)

import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const grammar = fileURLToPath(new URL(".", import.meta.url));
const root = join(grammar, "..", "..");
const folders = ["programs", "examples", "benches", "tests"];

/** Mistakes that are spelled like a program: `x <-1` reads as `x < -1`. */
const unseen = ["r_arrow.pcad"];

const programs = folders.flatMap(folder =>
  readdirSync(join(root, folder), { recursive: true })
    .filter(name => name.endsWith(".pcad"))
    .map(name => join(root, folder, name)),
);
const wrong = join(root, "programs", "errors", "parse");
const [bad, good] = [true, false].map(p => programs.filter(f => f.startsWith(wrong) === p));
if (good.length === 0 || bad.length === 0) {
  throw new Error(`no programs found in ${root}`);
}

const failures = withErrors(programs);
const messages = [
  ...good.filter(file => failures.has(file)).map(file => `does not parse: ${show(file)}`),
  ...bad
    .filter(file => failures.has(file) === unseen.some(name => file.endsWith(name)))
    .map(file => `${failures.has(file) ? "is now seen" : "parses"}: ${show(file)}`),
];
for (const message of messages) {
  console.error(message);
}
console.log(`${programs.length - messages.length} passed, ${messages.length} failed`);
process.exitCode = messages.length > 0 ? 1 : 0;

/** The files in whose trees there are ERROR or MISSING nodes. */
function withErrors(files) {
  const folder = mkdtempSync(join(tmpdir(), "tree-sitter-pcad-"));
  try {
    const list = join(folder, "files");
    writeFileSync(list, files.join("\n") + "\n");
    const bin = join(grammar, "node_modules", ".bin");
    const { error, status, stdout, stderr } = spawnSync(
      "tree-sitter", ["parse", "--json-summary", "--quiet", "--paths", list],
      {
        cwd: grammar,
        encoding: "utf8",
        env: { ...process.env, PATH: bin + delimiter + process.env.PATH },
        maxBuffer: 1 << 28,
      },
    );
    if (error) {
      throw error;
    }
    // Before the summary there is a line for each file with errors.
    const start = stdout.search(/^\{$/m);
    const summaries = start < 0 ? [] : JSON.parse(stdout.slice(start)).parse_summaries;
    if (summaries.length !== files.length) {
      throw new Error(`tree-sitter failed with code ${status}: ${stderr}`);
    }
    return new Set(summaries.filter(s => !s.successful).map(s => s.file));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

function show(file) {
  return relative(root, file);
}
