// The tree of addresses, sliders' ranges, the prompt's brackets and bytes, places in the address.

import assert from "node:assert/strict";
import test from "node:test";
import { buildTree, passes, splitAddress, visibleRows } from "../src/address_tree";
import { readPlace, writePlace } from "../src/fragment";
import { ranks } from "../src/plot_data";
import { byteLength, charOffset, isOpen } from "../src/prompt_panel";
import type { Choice } from "../src/protocol";
import { discreteValues, sliderRange } from "../src/selected_choice";
import { evenly, Spread } from "../src/uncertainty";

function choice(address: string, more: Partial<Choice> = {}): Choice {
  return {
    address,
    value: 0,
    text: "0",
    family: "normal",
    log_density: 0,
    support: null,
    low: null,
    high: null,
    scale: 1,
    tags: [],
    forced: false,
    frozen: false,
    acceptance: null,
    ...more,
  };
}

test("addresses are split at slashes outside brackets", () => {
  assert.deepEqual(splitAddress("@body/pose[a/b]/x"), ["body", "pose[a/b]", "x"]);
});

test("the tree has each branch once, and closed branches hide their choices", () => {
  const tree = buildTree(["@a", "@b/x", "@b/y", "@b"].map((a) => choice(a)));
  assert.deepEqual(tree.children.map((n) => [n.path, n.count]), [["@a", 1], ["@b", 3]]);
  assert.equal(tree.children[1]!.choice?.address, "@b");
  assert.equal(visibleRows(tree, () => false).length, 2);
  assert.deepEqual(visibleRows(tree, () => true).map((r) => r.depth), [0, 0, 1, 1]);
});

test("a branch with one child is one line with it", () => {
  const tree = buildTree(["@a/b/x", "@a/b/y", "@c/d"].map((a) => choice(a)));
  assert.deepEqual(tree.children.map((n) => [n.name, n.path]), [["a/b", "@a/b"], ["c/d", "@c/d"]]);
});

test("the filter looks at addresses, tags and families", () => {
  const c = choice("@body/arm", { tags: ["pose"] });
  assert.ok(passes(c, ["arm", "$pose"]) && passes(c, ["norm"]));
  assert.ok(!passes(c, ["leg"]));
});

test("a slider spans the support, or four scales around the value", () => {
  assert.deepEqual(sliderRange(choice("@a", { low: 0, high: 2 }), 1), [0, 2]);
  assert.deepEqual(sliderRange(choice("@a", { scale: 0.5 }), 1), [-1, 3]);
  assert.deepEqual(sliderRange(choice("@a", { low: 0, scale: 1 }), 3), [0, 7]);
});

test("discrete values have buttons", () => {
  assert.deepEqual(discreteValues(choice("@a", { value: true })), [false, true]);
  const words = choice("@a", { value: "x", support: 'one of "x", "y"' });
  assert.deepEqual(discreteValues(words), ["x", "y"]);
  assert.equal(discreteValues(choice("@a")), null);
});

test("the address keeps what is open", () => {
  const place = { token: "T", session: 3, run: "lathe-2", view: "draws", at: 4, tab: "trace" };
  assert.deepEqual(readPlace(writePlace(place)), place);
  assert.equal(readPlace("#token=T&session=x").session, null);
});

test("an entry goes on while a bracket is open", () => {
  assert.ok(isOpen("let a = f({"));
  assert.ok(!isOpen('let a = "(";') && !isOpen("f() // ("));
});

test("places in the prompt are counted in bytes", () => {
  assert.equal(byteLength("ä@x"), 4);
  assert.equal(charOffset("ä@x", 2), 1);
});

test("ranks are fractions of all draws, ties share theirs", () => {
  assert.deepEqual(ranks([[1, 3], [2, 2]]), [[0.125, 0.875], [0.5, 0.5]]);
});

test("the spread of two draws is that of their positions", () => {
  const mesh = (x: number) => ({
    topology: "k",
    parts: [],
    positions: Float32Array.of(x, 0, 0),
    normals: null,
    corners: new Uint32Array(),
    partOf: null,
  });
  const spread = new Spread("k", 3);
  assert.ok(spread.add(mesh(1)) && spread.add(mesh(3)));
  assert.ok(!spread.add({ ...mesh(9), topology: "other" }));
  assert.ok(Math.abs(spread.deviations()[0]! - Math.SQRT2) < 1e-6);
  assert.deepEqual(evenly(10, 2), [2, 7]);
});
