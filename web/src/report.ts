// The viewer of report.html: finds its place and its data in the page, needs no network, and
// does nothing where either is missing.

import { EmbeddedData, type EmbeddedScene } from "./embedded_data";
import { standaloneViewer } from "./standalone";

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
  place.style.height = "min(78vh, 720px)";
  standaloneViewer(place).setData(new EmbeddedData(scene));
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
else start();
