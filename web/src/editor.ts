// A CodeMirror editor for programs, without knowledge of sessions.

import { closeBrackets } from "@codemirror/autocomplete";
import { indentWithTab } from "@codemirror/commands";
import { indentUnit } from "@codemirror/language";
import { lintGutter, setDiagnostics, type Diagnostic as Mark } from "@codemirror/lint";
import { EditorState, Prec, type Extension } from "@codemirror/state";
import { EditorView, keymap } from "@codemirror/view";
import { basicSetup } from "codemirror";
import { pcadLanguage } from "./highlight";
import type { Diagnostic } from "./protocol";

/** The keys that the panel around the editor handles. */
interface EditorKeys {
  apply(): void;
  save(): void;
}

// CodeMirror's parts take the page's colours.
const theme = EditorView.theme({
  "&": { height: "100%", fontSize: "12.5px", color: "var(--text)", background: "var(--surface)" },
  "&.cm-focused": { outline: "none" },
  ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.5" },
  ".cm-content": { caretColor: "var(--text)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  ".cm-gutters": {
    background: "var(--surface)",
    color: "var(--faint)",
    borderRight: "1px solid var(--line)",
  },
  ".cm-activeLine": { background: "var(--active-line)" },
  ".cm-activeLineGutter": { background: "var(--active-line)", color: "var(--text)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground": {
    background: "var(--selection)",
  },
  ".cm-selectionBackground": { background: "var(--selection)" },
  ".cm-selectionMatch": { background: "var(--match)" },
  ".cm-matchingBracket": { background: "var(--match)", outline: "1px solid var(--line-strong)" },
  ".cm-tooltip": {
    background: "var(--raised)",
    color: "var(--text)",
    border: "1px solid var(--line-strong)",
    borderRadius: "4px",
    boxShadow: "var(--shadow)",
    fontFamily: "var(--sans)",
    maxWidth: "34em",
  },
  ".cm-tooltip pre, .cm-tooltip code": { fontFamily: "var(--mono)", fontSize: "12px" },
  ".cm-tooltip-autocomplete ul li[aria-selected]": {
    background: "var(--accent)",
    color: "var(--on-accent)",
  },
  ".cm-panels": {
    background: "var(--raised)",
    color: "var(--text)",
    borderColor: "var(--line)",
  },
  ".cm-foldPlaceholder": {
    background: "transparent",
    border: "1px solid var(--line-strong)",
    color: "var(--muted)",
  },
  ".cm-diagnostic": { borderLeftWidth: "3px", fontFamily: "var(--sans)", whiteSpace: "pre-wrap" },
});

/** The state of an editor on a text. */
export function editorState(
  text: string,
  keys: EditorKeys,
  onChange: (text: string) => void,
  more: Extension,
): EditorState {
  const run = (command: () => void) => () => {
    command();
    return true;
  };
  return EditorState.create({
    doc: text,
    extensions: [
      Prec.highest(
        keymap.of([
          { key: "Mod-Enter", run: run(keys.apply) },
          { key: "Mod-s", run: run(keys.save), preventDefault: true },
        ]),
      ),
      basicSetup,
      closeBrackets(),
      keymap.of([indentWithTab]),
      indentUnit.of("  "),
      EditorState.tabSize.of(2),
      lintGutter(),
      pcadLanguage(),
      more,
      theme,
      EditorView.contentAttributes.of({ "aria-label": "Program" }),
      EditorView.updateListener.of((update) => {
        if (update.docChanged) onChange(update.state.doc.toString());
      }),
    ],
  });
}

/** Replaces the text where it differs, so that the cursor and the history stay. */
export function replaceText(view: EditorView, text: string): void {
  const old = view.state.doc.toString();
  if (old === text) return;
  let start = 0;
  const least = Math.min(old.length, text.length);
  while (start < least && old[start] === text[start]) start++;
  let end = 0;
  while (end < least - start && old[old.length - 1 - end] === text[text.length - 1 - end]) end++;
  const insert = text.slice(start, text.length - end);
  view.dispatch({ changes: { from: start, to: old.length - end, insert } });
}

/** Marks the places that an answer's diagnostics name. */
export function showDiagnostics(view: EditorView, diagnostics: Diagnostic[]): void {
  const { doc } = view.state;
  const place = (line: number, column: number) => {
    const { from, to } = doc.line(Math.min(doc.lines, Math.max(1, line + 1)));
    return Math.min(to, from + column);
  };
  const marks = diagnostics.map((d): Mark => {
    const from = place(d.line, d.column);
    const to = Math.max(from, place(d.end_line, d.end_column));
    const severity = d.severity === "warning" || d.severity === "info" ? d.severity : "error";
    return { from, to, severity, message: d.hint ? `${d.message}\nhint: ${d.hint}` : d.message };
  });
  view.dispatch(setDiagnostics(view.state, marks));
  const first = marks[0];
  if (first) view.dispatch({ effects: EditorView.scrollIntoView(first.from, { y: "center" }) });
}
