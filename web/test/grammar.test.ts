// The interpreter of the TextMate grammar, on a sample and on the shipped programs.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import test from "node:test";
import { cellTokens, COLOURS } from "../src/cell_colours";
import type { Region } from "../src/grammar";
import { kindOf, streamMode, tokenizer } from "../src/tokens";

function scopes(line: string, region: Region = null): [string, string][] {
  return tokenizer.line(line, region).tokens.map(({ from, to, scope }) => {
    return [line.slice(from, to), scope!.split(".")[0]!];
  });
}

test("a statement has keywords, names, numbers and operators", () => {
  assert.deepEqual(scopes("assume H ~ uniform(1.5, 3) #size; // height"), [
    ["assume", "keyword"],
    ["H", "variable"],
    ["~", "keyword"],
    ["uniform", "entity"],
    ["1.5", "constant"],
    ["3", "constant"],
    ["#size", "entity"],
    ["// height", "comment"],
  ]);
});

test("addresses are one token, with their slashes and indices", () => {
  assert.deepEqual(scopes("force @body/pose[2] = 0;")[1], ["@body/pose[2]", "variable"]);
});

test("strings keep their escapes inside", () => {
  const line = 'let s = "a \\" b" + c;';
  const strings = tokenizer.line(line, null).tokens.filter((t) => /string|escape/.test(t.scope!));
  assert.equal(strings.map((t) => line.slice(t.from, t.to)).join(""), '"a \\" b"');
});

test("a block comment goes on over lines", () => {
  const first = tokenizer.line("let a = 1; /* one", null);
  assert.notEqual(first.region, null);
  const second = tokenizer.line("two */ let b = 2;", first.region);
  assert.equal(second.region, null);
  assert.equal(second.tokens[0]!.scope, "comment.block.pcad");
  assert.ok(second.tokens.some((t) => t.scope === "keyword.other.pcad"));
});

test("a mode of CodeMirror names the kinds of tokens, over lines", () => {
  const mode = streamMode((kind) => COLOURS[kind][0]);
  const state = mode.startState();
  const styles = (string: string) => {
    const stream = { string, pos: 0 };
    const found: [string, string][] = [];
    while (stream.pos < string.length) {
      const from = stream.pos;
      const style = mode.token(stream, state);
      if (style) found.push([string.slice(from, stream.pos), style]);
    }
    return found;
  };
  assert.deepEqual(styles("let a = f(@b); /* c"), [
    ["let", "keyword"],
    ["a", "variable"],
    ["=", "operator"],
    ["f", "def"],
    ["@b", "attribute"],
    ["/*", "comment"],
    [" c", "comment"],
  ]);
  assert.deepEqual(styles("d */ 1")[0], ["d */", "comment"]);
});

test("cells of notebooks have colours below their first line", () => {
  const tokens = cellTokens(["%%pcad line", "assume m ~ normal(0, 1);", 'let s = "', '";']);
  const first = tokens[0]!;
  assert.deepEqual(first, { kind: "keyword", line: 1, from: 0, to: 6 });
  assert.ok(tokens.every(({ line }) => line > 0));
  assert.ok(tokens.some(({ kind, line }) => kind === "string" && line === 2));
  assert.deepEqual(cellTokens(["import pcadlang"]), []);
});

test("every scope of the grammar has a colour", () => {
  const file = new URL("../../editors/vscode/syntaxes/pcad.tmLanguage.json", import.meta.url);
  const names = [...readFileSync(file, "utf8").matchAll(/"name": "([a-z.-]+\.[a-z.-]+)"/g)];
  assert.ok(names.length > 8);
  for (const [, name] of names) assert.ok(kindOf(name!) ?? name!.startsWith("punctuation"), name);
});

test("every shipped program is tokenized to its end, tokens in order", () => {
  const folder = new URL("../../programs/", import.meta.url);
  const programs = readdirSync(folder).filter((name) => name.endsWith(".pcad"));
  assert.ok(programs.length > 5);
  for (const name of programs) {
    let region: Region = null;
    for (const line of readFileSync(new URL(name, folder), "utf8").split("\n")) {
      const result = tokenizer.line(line, region);
      region = result.region;
      let end = 0;
      for (const token of result.tokens) {
        assert.ok(token.from >= end && token.to <= line.length, `${name}: ${line}`);
        end = token.to;
      }
    }
    assert.equal(region, null, `${name} ends inside a region`);
  }
});
