// Highlighting from the TextMate grammar that VS Code uses too: the parts of that format which
// the grammar has (match, begin and end, include), as a tokenizer of lines.

/** A rule of a TextMate grammar. */
export interface Rule {
  name?: string;
  match?: string;
  begin?: string;
  end?: string;
  include?: string;
  patterns?: Rule[];
}

/** A TextMate grammar. */
export interface Grammar {
  patterns: Rule[];
  repository: Record<string, Rule>;
}

interface Compiled {
  name: string | null;
  start: RegExp;
  end: RegExp | null;
  inner: Compiled[];
}

/** A piece of a line, and the scope it has. */
export interface Token {
  from: number;
  to: number;
  scope: string | null;
}

/** The region in which a line begins: null outside comments and strings. */
export type Region = Compiled | null;

/** A tokenizer for one grammar. */
export class Tokenizer {
  private readonly rules: Compiled[];

  constructor(private readonly grammar: Grammar) {
    this.rules = this.compile(grammar.patterns);
  }

  /** The next token from a place of a line, and the region after it. */
  next(line: string, from: number, region: Region): { token: Token; region: Region } {
    const rules = region ? region.inner : this.rules;
    const name = region?.name ?? null;
    const end = region?.end ? matchAt(region.end, line, from) : null;
    let best: { rule: Compiled; at: number; length: number } | null = null;
    for (const rule of rules) {
      const found = matchAt(rule.start, line, from);
      // Earlier rules win where two match at the same place, as in TextMate.
      if (found && (best === null || found.at < best.at)) best = { rule, ...found };
    }
    if (end && (best === null || end.at <= best.at)) {
      const to = end.at + end.length;
      return { token: { from, to, scope: name }, region: null };
    }
    if (best === null) return { token: { from, to: line.length, scope: name }, region };
    if (best.at > from) return { token: { from, to: best.at, scope: name }, region };
    const to = best.at + Math.max(1, best.length);
    const token = { from, to, scope: best.rule.name };
    return { token, region: best.rule.end ? best.rule : region };
  }

  /** All tokens of a line with a scope, and the region after the line. */
  line(line: string, region: Region): { tokens: Token[]; region: Region } {
    const tokens: Token[] = [];
    let at = 0;
    while (at < line.length) {
      const step = this.next(line, at, region);
      if (step.token.scope && step.token.to > step.token.from) tokens.push(step.token);
      at = Math.max(step.token.to, step.region === region ? at + 1 : at);
      region = step.region;
    }
    return { tokens, region };
  }

  private compile(rules: Rule[]): Compiled[] {
    return rules.flatMap((rule) => {
      if (rule.include) {
        const target = this.grammar.repository[rule.include.slice(1)];
        if (!target) throw new Error(`the grammar has no ${rule.include}`);
        return this.compile([target]);
      }
      const start = rule.match ?? rule.begin;
      if (start === undefined) return this.compile(rule.patterns ?? []);
      return [
        {
          name: rule.name ?? null,
          start: new RegExp(start, "g"),
          end: rule.end === undefined ? null : new RegExp(rule.end, "g"),
          inner: this.compile(rule.begin === undefined ? [] : (rule.patterns ?? [])),
        },
      ];
    });
  }
}

function matchAt(regexp: RegExp, line: string, from: number) {
  regexp.lastIndex = from;
  const match = regexp.exec(line);
  return match ? { at: match.index, length: match[0].length } : null;
}
