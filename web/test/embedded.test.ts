// The data of a report: positions as differences of 16 bits, deflated.

import assert from "node:assert/strict";
import test from "node:test";
import { deflateSync } from "node:zlib";
import { inflate, readCorners, readPositions } from "../src/embedded_data";

test("positions return from their differences, within a step of the grid", async () => {
  const low = [-1, 0, 2];
  const high = [1, 10, 2.5];
  const points = [
    [-1, 10, 2.25],
    [1, 0, 2],
    [0.3, 5, 2.5],
  ];
  const words = new Uint16Array(9);
  for (let axis = 0; axis < 3; axis++) {
    let before = 0;
    points.forEach((point, i) => {
      const q = Math.round(((point[axis]! - low[axis]!) / (high[axis]! - low[axis]!)) * 65535);
      words[3 * axis + i] = (q - before) & 0xffff;
      before = q;
    });
  }
  const text = deflateSync(Buffer.from(words.buffer)).toString("base64");
  const positions = readPositions(await inflate(text), low, high);
  points.flat().forEach((x, i) => assert.ok(Math.abs(positions[i]! - x) < 1e-3, `${i}`));
});

test("corners are little-endian numbers of 32 bits", () => {
  assert.deepEqual([...readCorners(Uint8Array.of(1, 0, 0, 0, 0, 1, 0, 0))], [1, 256]);
});
