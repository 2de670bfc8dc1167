"""Writes `docs/reference/python.md` from the docstrings of the installed package.

python reference.py          # prints it
python reference.py --write
"""

import inspect
import sys
from pathlib import Path
from typing import Any

import pcadlang
from pcadlang import notebook

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "python.md"

HEAD = """# The Python package

How to use it: [howto/python](../howto/python.md). This page is made from the docstrings by
`python/reference.py`; `help(pcadlang.Trace)` shows the same. Pictures are arrays of height x width,
rows from the top; lengths are in scene units, angles in radians, unless something else is said.
Wrong types are `TypeError`, wrong values and shapes `ValueError`, unknown addresses and names
`KeyError`; mistakes in a program or its run are `pcadlang.Error`.
"""

CLASSES = ["Program", "Model", "Posterior", "Trace", "Weight", "Update", "View", "Solid", "Host"]
OTHERS = ["Object", "Adjoint", "Error", "OutsideDomain", "CommandError"]
FUNCTIONS = ["to_arviz", "to_trimesh", "picture", "run", "evaluate", "learn", "tradeoff"]


def text(of: Any) -> str:
    """A docstring, as a paragraph or several."""
    return inspect.cleandoc(of.__doc__ or "")


def call(name: str, of: Any) -> str:
    """A method or function with its arguments, without types."""
    try:
        signature = inspect.signature(of)
    except (TypeError, ValueError):
        return f"{name}(…)"
    kept = [
        p.replace(annotation=p.empty)
        for p in signature.parameters.values()
        if p.name not in ("self", "cls")
    ]
    shown = signature.replace(parameters=kept, return_annotation=signature.empty)
    return f"{name}{shown}".replace("Ellipsis", "…")


def members(of: type) -> list[str]:
    """The methods and properties of a class, by name: their order in a class says nothing."""
    lines = []
    for name, member in sorted(vars(of).items(), key=lambda pair: pair[0].lower()):
        if name in ("__getitem__", "__setitem__", "__contains__"):
            said = {"__getitem__": "[name]", "__setitem__": "[name] = value"}
            shown = f"{of.__name__.lower()}{said[name]}" if name in said else ""
        elif name.startswith("_"):
            continue
        elif callable(member) or isinstance(member, staticmethod):
            shown = call(name, getattr(of, name))
        else:
            shown = name
        doc = text(member) if not isinstance(member, staticmethod) else text(getattr(of, name))
        # Python's own words for operators say nothing of this class.
        if shown and doc and not doc.startswith(("Return self", "Set self", "Return bool")):
            lines.append(f"* **`{shown}`** {doc}".replace("\n\n", "\n").replace("\n", "\n  "))
    return lines


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    for name in CLASSES + OTHERS:
        of = getattr(pcadlang, name)
        parts.append("\n".join([f"## `{name}`", "", text(of), "", *members(of)]).rstrip() + "\n")
    parts.append("## Functions\n")
    functions = [(name, getattr(pcadlang, name)) for name in FUNCTIONS]
    functions.append(("notebook.sample", notebook.sample))
    for name, of in functions:
        parts.append(f"### `{call(name, of)}`\n\n{text(of)}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    if "--write" in sys.argv:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        print(page())
