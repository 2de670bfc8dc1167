"""The display formatters of IPython, by type."""

from collections.abc import Callable
from typing import Any

from pcadlang._native import Posterior, Program, Solid, Trace, View
from pcadlang.notebook import display
from pcadlang.notebook.widget import solid_bundle

FORMATTERS: list[tuple[str, type, Callable[[Any], Any]]] = [
    ("text/html", Posterior, display.posterior_html),
    ("text/html", Trace, display.trace_html),
    ("text/html", Program, display.program_html),
    ("image/png", View, display.view_png),
]


def register(shell: Any) -> None:
    """Registers the formatters."""
    formatter = shell.display_formatter
    if formatter is None:
        return
    for kind, type_of, function in FORMATTERS:
        formatter.formatters[kind].for_type(type_of, function)
    formatter.mimebundle_formatter.for_type(Solid, solid_bundle)


def remove(shell: Any) -> None:
    """Takes them away."""
    formatter = shell.display_formatter
    if formatter is None:
        return
    for kind, type_of, _ in FORMATTERS:
        formatter.formatters[kind].pop(type_of, None)
    formatter.mimebundle_formatter.pop(Solid, None)
