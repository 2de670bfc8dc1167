"""What `%load_ext` loads: the magic, the formatters, colours in cells."""

from typing import Any


def load_ipython_extension(shell: Any) -> None:
    """Loads the extension; IPython calls it for `%load_ext`."""
    from pcadlang.notebook import cells, formatters, magic

    magic.register(shell)
    formatters.register(shell)
    cells.colour(shell)


def unload_ipython_extension(shell: Any) -> None:
    """Takes away what `load_ipython_extension` added."""
    from pcadlang.notebook import formatters

    shell.magics_manager.magics["cell"].pop("pcad", None)
    formatters.remove(shell)
