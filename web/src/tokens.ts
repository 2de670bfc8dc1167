// The tokens of programs: what the language's TextMate grammar finds, by the kinds that have a
// colour.

import grammar from "../../editors/vscode/syntaxes/pcad.tmLanguage.json";
import { Tokenizer, type Grammar, type Region } from "./grammar";

/** The tokenizer of programs. */
export const tokenizer = new Tokenizer(grammar as Grammar);

// The longest prefix of a scope's name decides.
const KINDS = [
  ["comment.", "comment"],
  ["string.", "string"],
  ["constant.character.escape", "escape"],
  ["constant.numeric", "number"],
  ["constant.language", "bool"],
  ["variable.other.constant.address", "address"],
  ["entity.other.attribute-name", "tag"],
  ["entity.name.function", "function"],
  ["keyword.operator.random", "random"],
  ["keyword.operator.word", "keyword"],
  ["keyword.operator", "operator"],
  ["keyword", "keyword"],
  ["variable.other.pcad", "variable"],
] as const;

/** A kind of tokens that have one colour. */
export type Kind = (typeof KINDS)[number][1];

/** The kind of a scope; null: it has no colour. */
export function kindOf(scope: string | null): Kind | null {
  return KINDS.find(([prefix]) => scope?.startsWith(prefix))?.[1] ?? null;
}

interface Stream {
  string: string;
  pos: number;
}

/** A mode of CodeMirror, in version 5 as in 6, from the names that it gives to the kinds. */
export function streamMode(style: (kind: Kind) => string) {
  return {
    startState: (): { region: Region } => ({ region: null }),
    copyState: ({ region }: { region: Region }) => ({ region }),
    token(stream: Stream, state: { region: Region }): string | null {
      const { token, region } = tokenizer.next(stream.string, stream.pos, state.region);
      // An end without length would stop CodeMirror, which asks for progress.
      stream.pos = Math.max(token.to, stream.pos + 1);
      state.region = region;
      const kind = kindOf(token.scope);
      return kind && style(kind);
    },
  };
}
