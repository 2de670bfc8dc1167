"""The cell magic `%%pcad`."""

import keyword
import re
from importlib import import_module
from typing import Any

from pcadlang._native import Error, Program

USAGE = "%%pcad NAME [--set NAME=VALUE] [--observe NAME=VALUE] [--camera VALUE] [--host VALUE]"
OPTION = re.compile(r"(?:^|\s)--(\w+)\s+")


class ProgramError(Exception):
    """A mistake in a cell. IPython shows its text alone, without a traceback of Python."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text

    def _render_traceback_(self) -> list[str]:
        return [coloured(line) for line in self.text.splitlines()]


def coloured(line: str) -> str:
    """A line of a message, coloured as a terminal has it."""
    colours = {"error": 31, "warning": 33, "note": 36}
    for word, colour in colours.items():
        if line.startswith(word):
            return f"\x1b[1;{colour}m{word}\x1b[0m{line[len(word) :]}"
    # The row of marks below a line of the excerpt.
    return re.sub(r"(?<=│ )(\s*)([\^]+.*)$", "\\1\x1b[31m\\2\x1b[0m", line)


def options(line: str) -> tuple[str, list[tuple[str, str]]]:
    """The name, and the options in their order, each with its text.

    Raises:
        ValueError: if the line is not as `USAGE` has it.
    """
    name, *rest = OPTION.split(line.strip())
    name = name.strip()
    if not name.isidentifier() or keyword.iskeyword(name):
        raise ValueError(f"a name for the program is needed: {USAGE}")
    pairs = list(zip(rest[::2], (text.strip() for text in rest[1::2]), strict=True))
    for option, text in pairs:
        if option not in ("set", "observe", "camera", "host"):
            raise ValueError(f"unknown option --{option}: {USAGE}")
        if option in ("set", "observe") and not re.match(r"\w+\s*=(?!=)", text):
            raise ValueError(f"--{option} needs NAME=VALUE, not {text!r}: {USAGE}")
    return name, pairs


def program(shell: Any, pairs: list[tuple[str, str]], cell: str) -> Program:
    """The program of a cell, with its options."""
    # The line of the magic counts, so that messages have the lines of the cell.
    made = Program.parse("\n" + cell)
    for option, text in pairs:
        if option in ("set", "observe"):
            key, _, text = (part.strip() for part in text.partition("="))
            method = made.set if option == "set" else made.observe
            made = method(**{key: shell.ev(text)})
        else:
            made = getattr(made, option)(shell.ev(text))
    # Mistakes are to be found here, also those that only the data show. Data may be given later.
    made.compile(without_data=True)
    return made


def pcad(shell: Any, line: str, cell: str) -> None:
    """Binds the program of a cell to a name, or shows the mistakes in it.

    Values of options are expressions of Python; a host's functions are known to the program.
    """
    try:
        name, pairs = options(line)
    except ValueError as e:
        raise import_module("IPython.core.error").UsageError(str(e)) from None
    # A program with a mistake must not leave an earlier one under its name.
    shell.user_ns.pop(name, None)
    try:
        shell.user_ns[name] = program(shell, pairs, cell)
    except Error as e:
        raise ProgramError(str(e).replace("<program>", f"%%pcad {name}")) from None


def register(shell: Any) -> None:
    """Registers the magic."""

    def cell_magic(line: str, cell: str) -> None:
        pcad(shell, line, cell)

    cell_magic.__doc__ = f"{pcad.__doc__}\n    {USAGE}\n"
    # `{` and `$` in the line are those of expressions.
    no_var_expand = import_module("IPython.core.magic").no_var_expand
    shell.register_magic_function(no_var_expand(cell_magic), "cell", "pcad")
