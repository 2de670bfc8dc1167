"""Colours of the language in cells that begin with `%%pcad`."""

import json
from importlib import import_module
from importlib.resources import files
from typing import Any

from pcadlang.notebook import words
from pcadlang.notebook.lazily import display


def script() -> str:
    """The script, with the words of the language."""
    patterns = [
        ["comment", r"//[^\n]*|/\*[^]*?(?:\*/|$)"],
        ["string", r'"(?:\\[^]|[^"\\])*(?:"|$)'],
        ["label", words.ADDRESS],
        ["tag", words.TAG],
        ["number", words.NUMBER],
        ["keyword", rf"\b(?:{'|'.join(words.DECLARATIONS + words.CONTROL)})\b"],
        ["keyword", rf"\b(?:{'|'.join(words.OPERATORS + words.CONSTANTS)})\b"],
        ["function", rf"{words.NAME}(?=\s*\()"],
        ["name", words.NAME],
        ["operator", r"[^\s\w]"],
    ]
    text = files("pcadlang.notebook").joinpath("cells.js").read_text(encoding="utf-8")
    return text.replace("PATTERNS", json.dumps(patterns))


def colour(shell: Any) -> None:
    """Sends the script to the page. Terminals and tests have none."""
    if getattr(shell, "kernel", None) is None:
        return
    display(import_module("IPython.display").Javascript(script()))
