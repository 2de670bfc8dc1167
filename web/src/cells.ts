// Paints cells of notebooks that begin with %%pcad. Jupyter takes them for Python, and a page can
// register no other language there: the CSS Custom Highlight API paints over the editor without
// changing it.

import { cellTokens, COLOURS } from "./cell_colours";
import { streamMode, type Kind } from "./tokens";

/** The parts of a notebook's page that may exist; the classic one has CodeMirror 5. */
interface Page {
  pcadCells?: boolean;
  CodeMirror?: { defineMode(name: string, make: () => object): void };
  IPython?: {
    CodeCell?: { options_default: { highlight_modes: Record<string, { reg: RegExp[] }> } };
    notebook?: { get_cells(): { auto_highlight?(): void }[] };
  };
}

function start(page: Page): void {
  if (page.pcadCells) return;
  page.pcadCells = true;
  const { CodeMirror, IPython } = page;
  if (IPython?.CodeCell && CodeMirror) {
    CodeMirror.defineMode("pcad", () => streamMode((kind) => COLOURS[kind][0]));
    IPython.CodeCell.options_default.highlight_modes.magic_pcad = { reg: [/^%%pcad/] };
    IPython.notebook?.get_cells().forEach((cell) => cell.auto_highlight?.());
  } else if (globalThis.CSS?.highlights && globalThis.Highlight) {
    paintOver();
  }
}

function paintOver(): void {
  const highlights = {} as Record<Kind, Highlight>;
  const style = document.createElement("style");
  for (const [kind, [name, colour]] of Object.entries(COLOURS)) {
    const rule = `color: var(--jp-mirror-editor-${name}-color, ${colour})`;
    style.append(`::highlight(pcad-${kind}) { ${rule} }\n`);
    CSS.highlights.set(`pcad-${kind}`, (highlights[kind as Kind] = new Highlight()));
  }
  document.head.append(style);
  const paint = () => {
    for (const highlight of Object.values(highlights)) highlight.clear();
    for (const editor of document.querySelectorAll(".cm-content")) {
      const lines = [...editor.querySelectorAll(".cm-line")];
      for (const { kind, line, from, to } of cellTokens(lines.map((l) => l.textContent ?? ""))) {
        for (const range of ranges(lines[line]!, from, to)) highlights[kind].add(range);
      }
    }
  };
  let due = 0;
  const later = () => {
    due ||= requestAnimationFrame(() => {
      due = 0;
      paint();
    });
  };
  const changes = { childList: true, characterData: true, subtree: true };
  new MutationObserver(later).observe(document.body, changes);
  later();
}

/** The parts of a line's text nodes between two places of the line. */
function ranges(line: Element, from: number, to: number): Range[] {
  const found: Range[] = [];
  const walk = document.createTreeWalker(line, NodeFilter.SHOW_TEXT);
  let start = 0;
  for (let node = walk.nextNode() as Text | null; node; node = walk.nextNode() as Text | null) {
    const [first, last] = [Math.max(from - start, 0), Math.min(to - start, node.length)];
    start += node.length;
    if (first >= last) continue;
    const range = document.createRange();
    range.setStart(node, first);
    range.setEnd(node, last);
    found.push(range);
  }
  return found;
}

start(globalThis as unknown as Page);
