"""Colours of the language in cells that begin with `%%pcad`."""

from importlib import import_module
from importlib.resources import files
from typing import Any

from pcadlang.notebook.lazily import display


def script() -> str:
    """What paints the cells of the page; `web/src/cells.ts` is its source."""
    return files("pcadlang.notebook").joinpath("cells.js").read_text(encoding="utf-8")


def colour(shell: Any) -> None:
    """Sends the script to the page. Terminals and tests have none."""
    if getattr(shell, "kernel", None) is None:
        return
    display(import_module("IPython.display").Javascript(script()))
