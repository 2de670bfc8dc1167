// The colours of programs in notebooks: which tokens a cell has, in the names of its editor.

import { kindOf, tokenizer, type Kind } from "./tokens";
import type { Region } from "./grammar";

/** CodeMirror's name of a kind, which Jupyter's themes have a colour for, and a colour for pages
 * without such a theme. */
export const COLOURS: Record<Kind, [name: string, colour: string]> = {
  comment: ["comment", "#408080"],
  string: ["string", "#ba2121"],
  escape: ["string", "#ba2121"],
  number: ["number", "#080"],
  bool: ["keyword", "#008000"],
  address: ["attribute", "#00c"],
  tag: ["attribute", "#00c"],
  function: ["def", "#00f"],
  random: ["operator", "#7800c2"],
  keyword: ["keyword", "#008000"],
  operator: ["operator", "#7800c2"],
  variable: ["variable", "#212121"],
};

/** A token of a cell: its line, and its place there. */
export interface CellToken {
  kind: Kind;
  line: number;
  from: number;
  to: number;
}

/** The tokens of a cell's lines; none if it is not one of `%%pcad`. */
export function cellTokens(lines: string[]): CellToken[] {
  if (!lines[0]?.startsWith("%%pcad")) return [];
  let region: Region = null;
  return lines.flatMap((text, line) => {
    if (line === 0) return [];
    const result = tokenizer.line(text, region);
    region = result.region;
    return result.tokens.flatMap(({ from, to, scope }) => {
      const kind = kindOf(scope);
      return kind ? [{ kind, line, from, to }] : [];
    });
  });
}
