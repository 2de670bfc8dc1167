// Colours of pcad in cells that begin with %%pcad, where the page offers no way to register a language.
// Jupyter calls them Python; the CSS Custom Highlight API paints over that without changing the editor.
(() => {
  if (window.pcadCells) return;
  window.pcadCells = true;
  const patterns = PATTERNS;
  const token = new RegExp(patterns.map(([, p]) => `(${p})`).join("|"), "g");
  const COLOURS = {
    comment: ["comment", "#408080"],
    string: ["string", "#ba2121"],
    label: ["attribute", "#00c"],
    tag: ["attribute", "#00c"],
    number: ["number", "#080"],
    keyword: ["keyword", "#008000"],
    function: ["def", "#00f"],
    name: ["variable", "#212121"],
    operator: ["operator", "#7800c2"],
  };

  function* tokens(text) {
    for (const m of text.matchAll(token)) {
      const which = patterns.findIndex((_, i) => m[i + 1] !== undefined);
      yield [patterns[which][0], m.index, m.index + m[0].length];
    }
  }

  // The notebook of old has CodeMirror 5, and modes for magics.
  if (window.IPython?.CodeCell && window.CodeMirror) {
    CodeMirror.defineMode("pcad", () => ({
      token(stream) {
        const rest = stream.string.slice(stream.pos);
        const [kind, from, to] = tokens(rest).next().value ?? ["", rest.length, rest.length];
        stream.pos += from > 0 ? from : Math.max(to, 1);
        return from > 0 || kind === "name" ? null : kind === "label" || kind === "tag" ? "attribute" : kind;
      },
    }));
    IPython.CodeCell.options_default.highlight_modes.magic_pcad = { reg: [/^%%pcad/] };
    IPython.notebook?.get_cells().forEach((c) => c.auto_highlight?.());
    return;
  }
  if (!window.CSS?.highlights || !window.Highlight) return;

  const style = document.createElement("style");
  style.textContent = Object.entries(COLOURS)
    .map(([k, [v, c]]) => `::highlight(pcad-${k}){color:var(--jp-mirror-editor-${v}-color,${c})}`)
    .join("");
  document.head.append(style);
  const painted = Object.fromEntries(Object.keys(COLOURS).map((k) => [k, new Highlight()]));
  for (const [kind, highlight] of Object.entries(painted)) CSS.highlights.set(`pcad-${kind}`, highlight);

  function paint() {
    for (const highlight of Object.values(painted)) highlight.clear();
    for (const editor of document.querySelectorAll(".cm-content")) {
      if (editor.firstElementChild?.textContent.startsWith("%%pcad")) paintCell(editor);
    }
  }

  function paintCell(editor) {
    // The text with the place of each part in the page; lines end where elements do.
    let text = "";
    const parts = [];
    [...editor.querySelectorAll(".cm-line")].forEach((line, i) => {
      if (i === 0) return;
      const walk = document.createTreeWalker(line, NodeFilter.SHOW_TEXT);
      for (let node = walk.nextNode(); node; node = walk.nextNode()) {
        parts.push([text.length, node]);
        text += node.data;
      }
      text += "\n";
    });
    for (const [kind, from, to] of tokens(text)) {
      for (const [start, node] of parts) {
        const a = Math.max(from - start, 0);
        const b = Math.min(to - start, node.length);
        if (a >= b) continue;
        const range = document.createRange();
        range.setStart(node, a);
        range.setEnd(node, b);
        painted[kind].add(range);
      }
    }
  }

  let due = 0;
  const later = () => (due ||= requestAnimationFrame(() => ((due = 0), paint())));
  new MutationObserver(later).observe(document.body, { childList: true, characterData: true, subtree: true });
  later();
})();
