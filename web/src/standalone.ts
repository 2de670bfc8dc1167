// The viewer within a page that has a style of its own: a report, a notebook.

import controls from "./controls.css";
import frame from "./standalone.css";
import viewerStyle from "./viewer.css";
import { h } from "./dom";
import { themed } from "./standalone_theme";
import { Viewer } from "./viewer";

/** A viewer in a place of the page; the viewer's style holds inside that place only. */
export function standaloneViewer(place: HTMLElement): Viewer {
  const inside = `.pcadlang-viewer { ${controls} ${viewerStyle} ${frame} }`;
  const viewer = new Viewer();
  place.classList.add("pcadlang-viewer");
  place.replaceChildren(h("style", {}, `${themed(".pcadlang-viewer")}\n${inside}`), viewer.element);
  return viewer;
}
