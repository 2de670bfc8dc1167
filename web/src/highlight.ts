// The language of programs for CodeMirror: the grammar's tokens, and their colours.

import { HighlightStyle, LanguageSupport, StreamLanguage } from "@codemirror/language";
import { syntaxHighlighting } from "@codemirror/language";
import { tags as t, type Tag } from "@lezer/highlight";
import { streamMode, type Kind } from "./tokens";

const TAGS: Record<Kind, Tag> = {
  comment: t.comment,
  string: t.string,
  escape: t.escape,
  number: t.number,
  bool: t.bool,
  address: t.labelName,
  tag: t.attributeName,
  function: t.function(t.variableName),
  random: t.definitionOperator,
  keyword: t.keyword,
  operator: t.operator,
  variable: t.variableName,
};

const language = StreamLanguage.define({
  name: "pcad",
  ...streamMode((kind) => kind),
  tokenTable: TAGS,
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
