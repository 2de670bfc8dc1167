// The interpreter of the TextMate grammar, on a sample and on the shipped programs.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import test from "node:test";
import { Tokenizer, type Grammar, type Region } from "../src/grammar";

const file = new URL("../../editors/vscode/syntaxes/pcad.tmLanguage.json", import.meta.url);
const tokenizer = new Tokenizer(JSON.parse(readFileSync(file, "utf8")) as Grammar);

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
