// The widget of the Python package: the viewer of a solid in a notebook, for anywidget.

import { NotebookData, type WidgetModel } from "./notebook_data";
import { standaloneViewer } from "./standalone";

/** Draws the model in the output of a cell; the result ends that. */
function render({ model, el }: { model: WidgetModel; el: HTMLElement }): () => void {
  const place = document.createElement("div");
  place.style.cssText = "max-width: 560px; height: 400px";
  // Keys that work the viewer are not also Jupyter's.
  place.setAttribute("data-lm-suppress-shortcuts", "true");
  el.append(place);
  const viewer = standaloneViewer(place);
  viewer.setData(new NotebookData(model, viewer.has3D));
  // The parts of a mesh change together.
  const changed = () => viewer.refresh();
  model.on("change:vertices", changed);
  return () => {
    model.off("change:vertices", changed);
    viewer.dispose();
  };
}

export default { render };
