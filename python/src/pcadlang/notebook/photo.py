"""Showing a result over a photograph, and what counts as a photograph."""

import os
from typing import Any

import numpy as np

from pcadlang._native import Posterior, Trace, View
from pcadlang.notebook.display import Photo, posterior_html, trace_html
from pcadlang.notebook.html import image
from pcadlang.notebook.lazily import display, markup


def pixels(photo: Any) -> Photo | None:
    """A photograph as height x width x 3 bytes: from a path, a picture of PIL, or an array."""
    if photo is None:
        return None
    if isinstance(photo, str | os.PathLike):
        import PIL.Image

        with PIL.Image.open(photo) as file:
            return np.asarray(file.convert("RGB"))
    if hasattr(photo, "convert"):
        return np.asarray(photo.convert("RGB"))
    return np.asarray(photo, np.uint8)


def show(result: Posterior | Trace | View, photo: Any = None) -> None:
    """Displays a posterior, a trace or a view over a photograph.

    Args:
        result: What is shown.
        photo: A path (which needs Pillow), a picture of PIL, or an array of height x width x 3
            bytes.

    Raises:
        TypeError: for another result.
    """
    under = pixels(photo)
    if isinstance(result, Posterior):
        text = posterior_html(result, under)
    elif isinstance(result, Trace):
        text = trace_html(result, under)
    elif isinstance(result, View):
        text = image(result.overlay(under), "the scene")
    else:
        raise TypeError(f"a {type(result).__name__} has no picture")
    display(markup(text))
