"""Solids in three dimensions: a widget where anywidget is installed, and a picture everywhere."""

import functools
from importlib import import_module
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pcadlang._native import Program, Solid
from pcadlang.notebook.html import png, smaller

SIZE = 320
"""The side of the fallback's picture, in pixels."""

# The engine draws the picture, too.
DRAWN = 'include "std/scene.pcad" as scene; data solid; let view = scene.render(solid);'


def picture(solid: Solid) -> NDArray[np.uint8]:
    """The solid seen from the front: height x width x 3 bytes."""
    vertices, _ = solid.mesh()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2
    wide = float(np.linalg.norm(high - low))
    camera = {
        "model": "orthographic",
        "position": [float(middle[0]), float(middle[1]), float(middle[2]) + 2 * wide],
        "looks_along": [0, 0, -1],
        "up": [0, 1, 0],
        "image": [SIZE, SIZE],
        "units_per_pixel": max(float((high - low)[:2].max()), 1e-9) * 1.1 / SIZE,
    }
    program = Program.parse(DRAWN).observe(solid=solid).camera(camera)
    view = program.compile().simulate().view("view")
    # Overlays are drawn larger than a small camera.
    return smaller(view.overlay(), 2 * SIZE)


def script() -> str:
    """What draws the mesh in the page; `web/src/notebook.ts` is its source."""
    return files("pcadlang.notebook").joinpath("widget.js").read_text(encoding="utf-8")


@functools.cache
def widget_class() -> Any:
    """The class of widgets.

    Raises:
        ImportError: if anywidget is not installed (`pip install pcadlang[notebook]`).
    """
    anywidget: Any = import_module("anywidget")
    traitlets: Any = import_module("traitlets")

    class SolidWidget(anywidget.AnyWidget):  # type: ignore[misc]
        """A mesh in the viewer of the studio and of reports. It needs no network."""

        _esm = script()
        vertices = traitlets.Bytes().tag(sync=True)
        triangles = traitlets.Bytes().tag(sync=True)
        # For browsers without WebGL.
        picture = traitlets.Bytes().tag(sync=True)

        def show(self, solid: Solid) -> None:
            """Shows another solid; the view stays as it was turned."""
            vertices, triangles = solid.mesh()
            with self.hold_sync():
                self.vertices = vertices.astype("<f4").tobytes()
                self.triangles = triangles.astype("<u4").tobytes()
                self.picture = png(picture(solid))

    return SolidWidget


def widget(solid: Solid) -> Any:
    """A widget of a solid. Its method `show` changes the solid.

    Raises:
        ImportError: if anywidget is not installed (`pip install pcadlang[notebook]`).
    """
    made = widget_class()()
    made.show(solid)
    return made


def solid_bundle(solid: Solid, **_: Any) -> dict[str, Any]:
    """What a notebook shows of a solid: the widget, or the picture where it has no widgets."""
    bundle: dict[str, Any] = {"text/plain": repr(solid)}
    vertices, _triangles = solid.mesh()
    if len(vertices) == 0:
        return bundle
    bundle["image/png"] = png(picture(solid))
    try:
        made = widget(solid)
    except ImportError:
        return bundle
    given = made._repr_mimebundle_()
    parts = given[0] if isinstance(given, tuple) else given
    return {**(parts or {}), **bundle}
