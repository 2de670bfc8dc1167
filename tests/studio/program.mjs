// Starts the program on a temporary folder, and ends it.

import { spawn } from "node:child_process";
import { cpSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const images = fileURLToPath(new URL("../../examples/images", import.meta.url));

/** Starts `pcadlang studio`: with arguments on a folder with copies of the example photographs,
 * without them on an empty one. */
export async function startProgram(binary, ...more) {
  const folder = mkdtempSync(join(tmpdir(), "pcadlang-studio-"));
  if (more.length > 0) cpSync(images, join(folder, "images"), { recursive: true });
  const child = spawn(binary, ["studio", ...more, "--port", "0"], {
    cwd: folder,
    stdio: ["ignore", "pipe", "pipe"],
  });
  let said = "";
  const address = await new Promise((resolve, reject) => {
    const late = setTimeout(() => reject(new Error(`no address after 60 s:\n${said}`)), 60_000);
    const read = (data) => {
      said += data;
      const match = said.match(/http:\/\/\S+#token=\S+/);
      if (!match) return;
      clearTimeout(late);
      resolve(match[0]);
    };
    child.stdout.on("data", read);
    child.stderr.on("data", read);
    child.on("error", reject);
    child.on("exit", (code) => reject(new Error(`the program ended (${code}):\n${said}`)));
  });
  return {
    address,
    folder,
    said: () => said,
    async end() {
      const ended = new Promise((resolve) => child.once("exit", resolve));
      child.kill("SIGINT");
      // A program that does not end on Ctrl-C must not keep the test waiting.
      const force = setTimeout(() => child.kill("SIGKILL"), 20_000);
      await ended;
      clearTimeout(force);
      rmSync(folder, { recursive: true, force: true });
    },
  };
}
