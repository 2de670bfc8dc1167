// Pointing out an object: what presses and drags make of a hint.

import assert from "node:assert/strict";
import test from "node:test";
import { axisSides, hintKey, isEmpty, NO_HINT, Pointing, type Tool } from "../src/pointing";
import type { Point } from "../src/protocol";

function pointing(tool: Tool): Pointing {
  const p = new Pointing();
  p.tool = tool;
  return p;
}

/** Presses at the first position and drags through the others; whether the hint changed. */
function drag(p: Pointing, ...[first, ...rest]: Point[]): boolean {
  p.press(first!, 4);
  for (const at of rest) p.drag(at);
  return p.release();
}

test("a click is on the object, beside it, and gone", () => {
  const p = pointing("point");
  assert.ok(isEmpty(p.hint));
  assert.ok(drag(p, [10, 20]));
  assert.deepEqual([p.hint.at, p.hint.not], [[[10, 20]], []]);
  p.press([50, 50], 4, true);
  assert.ok(p.release());
  assert.deepEqual(p.hint.not, [[50, 50]]);
  drag(p, [12, 21]);
  assert.deepEqual([p.hint.at, p.hint.not], [[], [[50, 50], [10, 20]]]);
  drag(p, [10, 20]);
  drag(p, [50, 50]);
  assert.ok(isEmpty(p.hint));
});

test("a box is dragged in any direction, and by its corners", () => {
  const p = pointing("box");
  assert.ok(drag(p, [40, 60], [5, 5], [10, 20.5]));
  assert.deepEqual(p.hint.box, [10, 20.5, 30, 39.5]);
  assert.ok(drag(p, [41, 21], [50, 0]));
  assert.deepEqual(p.hint.box, [10, 0, 40, 60]);
  assert.ok(!drag(p, [100, 100], [101, 130]), "a slip changes nothing");
  assert.ok(!drag(p, [100, 100]));
  assert.deepEqual(p.hint.box, [10, 0, 40, 60]);
});

test("an axis goes from foot to top, and its sides give the width", () => {
  const p = pointing("axis");
  assert.ok(drag(p, [50, 90], [50, 10]));
  assert.deepEqual(p.hint.axis, { foot: [50, 90], top: [50, 10], width: 40 });
  assert.deepEqual(axisSides(p.hint.axis!), [[70, 50], [30, 50]]);
  drag(p, [31, 50], [20, 80]);
  assert.equal(p.hint.axis!.width, 60);
  drag(p, [50, 11], [60, 5]);
  assert.deepEqual([p.hint.axis!.top, p.hint.axis!.width], [[60, 5], 60]);
});

test("an outline is closed, moved, and cut", () => {
  const p = pointing("outline");
  const click = (at: Point, other = false) => {
    p.press(at, 4, other);
    return p.release();
  };
  click([0, 0]);
  click([0, 0]);
  click([90, 0]);
  assert.ok(!p.close() && isEmpty(p.hint));
  click([90, 90]);
  click([0, 90]);
  assert.ok(click([1, 91]), "the second press of a double click closes");
  assert.deepEqual(p.hint.outline, [[0, 0], [90, 0], [90, 90], [0, 90]]);
  assert.ok(drag(p, [90, 0], [80, 10]));
  assert.deepEqual(p.hint.outline[1], [80, 10]);
  assert.ok(click([80, 10], true));
  assert.equal(p.hint.outline.length, 3);
  click([40, 40]);
  assert.ok(p.cancel() && !p.cancel());
  assert.equal(p.hint.outline.length, 3, "the closed outline stays");
  assert.ok(click([0, 0], true));
  assert.ok(isEmpty(p.hint), "two corners are no outline");
});

test("what is given up is as it was", () => {
  const p = pointing("box");
  drag(p, [0, 0], [20, 20]);
  p.press([50, 50], 4);
  p.drag([90, 90]);
  assert.ok(p.dragging && p.cancel());
  assert.deepEqual(p.hint.box, [0, 0, 20, 20]);
  p.hint = { ...p.hint, at: [[3, 3]] };
  assert.ok(p.remove() && !p.remove());
  assert.deepEqual([p.hint.box, p.hint.at], [null, [[3, 3]]]);
});

test("equal hints have one key, whatever the order of their fields", () => {
  const { at, axis, box, mask, not, outline } = NO_HINT;
  assert.equal(hintKey(NO_HINT), hintKey({ at, axis, box, mask, not, outline }));
  assert.notEqual(hintKey(NO_HINT), hintKey({ ...NO_HINT, at: [[1, 2]] }));
});
