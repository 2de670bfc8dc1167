// The language of programs for CodeMirror: tokens from the TextMate grammar, and their colours.

import { HighlightStyle, LanguageSupport, StreamLanguage } from "@codemirror/language";
import { syntaxHighlighting } from "@codemirror/language";
import { tags as t, type Tag } from "@lezer/highlight";
import grammar from "../../editors/vscode/syntaxes/pcad.tmLanguage.json";
import { Tokenizer, type Grammar, type Region } from "./grammar";

const tokenizer = new Tokenizer(grammar as Grammar);

// The longest prefix of a scope's name decides.
const SCOPES: [string, string, Tag][] = [
  ["comment.", "comment", t.comment],
  ["string.", "string", t.string],
  ["constant.character.escape", "escape", t.escape],
  ["constant.numeric", "number", t.number],
  ["constant.language", "bool", t.bool],
  ["variable.other.constant.address", "address", t.labelName],
  ["entity.other.attribute-name", "tag", t.attributeName],
  ["entity.name.function", "function", t.function(t.variableName)],
  ["keyword.operator.random", "random", t.definitionOperator],
  ["keyword.operator.word", "keyword", t.keyword],
  ["keyword.operator", "operator", t.operator],
  ["keyword", "keyword", t.keyword],
  ["variable.other.pcad", "variable", t.variableName],
];

function styleOf(scope: string | null): string | null {
  return SCOPES.find(([prefix]) => scope?.startsWith(prefix))?.[1] ?? null;
}

const language = StreamLanguage.define<{ region: Region }>({
  name: "pcad",
  startState: () => ({ region: null }),
  copyState: ({ region }) => ({ region }),
  token(stream, state) {
    const { token, region } = tokenizer.next(stream.string, stream.pos, state.region);
    // An end without length would stop CodeMirror, which asks for progress.
    stream.pos = Math.max(token.to, stream.pos + 1);
    state.region = region;
    return styleOf(token.scope);
  },
  tokenTable: Object.fromEntries(SCOPES.map(([, name, tag]) => [name, tag])),
  languageData: {
    commentTokens: { line: "//", block: { open: "/*", close: "*/" } },
    closeBrackets: { brackets: ["(", "[", "{", '"'] },
    indentOnInput: /^\s*[}\])]$/,
  },
});

// Colours are variables of the page's style, so that both themes have theirs.
const style = HighlightStyle.define([
  { tag: t.comment, color: "var(--code-comment)", fontStyle: "italic" },
  { tag: t.string, color: "var(--code-string)" },
  { tag: t.escape, color: "var(--code-string)", fontWeight: "bold" },
  { tag: [t.number, t.bool], color: "var(--code-number)" },
  { tag: t.labelName, color: "var(--code-address)" },
  { tag: t.attributeName, color: "var(--code-tag)" },
  { tag: t.function(t.variableName), color: "var(--code-function)" },
  { tag: t.definitionOperator, color: "var(--code-keyword)", fontWeight: "bold" },
  { tag: t.keyword, color: "var(--code-keyword)" },
  { tag: t.operator, color: "var(--code-operator)" },
]);

/** The language and its colours. */
export function pcadLanguage(): LanguageSupport {
  return new LanguageSupport(language, [syntaxHighlighting(style)]);
}
