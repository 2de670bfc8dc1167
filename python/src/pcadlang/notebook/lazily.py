"""What is imported when it is needed: neither IPython nor anywidget must be installed."""

from importlib import import_module
from typing import Any


def display(shown: Any, **options: Any) -> Any:
    """Shows an object in the cell's output, as `IPython.display.display` does."""
    return import_module("IPython.display").display(shown, **options)


def markup(text: str) -> Any:
    """Text that is shown as HTML."""
    return import_module("IPython.display").HTML(text)
