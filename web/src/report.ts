// The viewer of report.html: finds its place and its data in the page, needs no network, and
// does nothing where either is missing.

import controls from "./controls.css";
import reportStyle from "./report.css";
import theme from "./theme.css";
import viewerStyle from "./viewer.css";
import { EmbeddedSource, type EmbeddedScene } from "./embedded_source";
import { h } from "./dom";
import { Viewer } from "./viewer";

function start(): void {
  const place = document.getElementById("viewer");
  const text = document.getElementById("scene")?.textContent?.trim();
  if (!place || !text) return;
  let scene: EmbeddedScene;
  try {
    scene = JSON.parse(text) as EmbeddedScene;
  } catch (error) {
    place.textContent = `The scene in this page cannot be read: ${String(error)}`;
    return;
  }
  if (!scene?.draws?.length) return;
  // The report has a style of its own: ours is kept inside the viewer by nesting.
  const variables = theme.replaceAll(":root", "#viewer");
  const inside = `#viewer { ${controls} ${viewerStyle} ${reportStyle} }`;
  document.head.append(h("style", {}, `${variables}\n${inside}`));
  const viewer = new Viewer();
  place.replaceChildren(viewer.element);
  viewer.setSource(new EmbeddedSource(scene));
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
else start();
