"""Files of settings, as `tradeoff` reads them: all distinct settings, and their names."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from pcadlang.command import CommandError
from pcadlang.ray.inputs import text

Setting = dict[str, Any]
OWN = ("program", "chains", "time", "steps", "warmup")


def read(paths: Sequence[Path]) -> dict[str, Setting]:
    """The settings of files, by name.

    Raises:
        CommandError: if a file has random settings, which only the command can draw.
    """
    named: dict[str, Setting] = {}
    for path in paths:
        plan = json.loads(path.read_text("utf-8"))
        if plan.get("random"):
            raise CommandError(f"{path}: `random` is not possible on a cluster")
        for setting in expanded(plan):
            named.setdefault(name(setting), setting)
    return named


def expanded(plan: dict[str, Any]) -> Iterable[Setting]:
    """All settings of a file, the base first."""
    changes: list[Setting] = [{}]
    for key, values in plan.get("vary", {}).items():
        changes += [{key: value} for value in values]
    changes += plan.get("also", [])
    for key, values in plan.get("cross", {}).items():
        # A change that sets the name itself keeps its value.
        changes = [{**c, key: c.get(key, value)} for c in changes for value in values]
    for change in changes:
        yield {**plan.get("base", {}), **change}


def name(setting: Setting) -> str:
    """The name of a setting, as the command has it."""
    own = [f"{key}={number(setting[key])}" for key in OWN if key in setting]
    rest = [f"{key}={shown(value)}" for key, value in setting.items() if key not in OWN]
    return " ".join(own + rest) or "defaults"


def number(value: Any) -> str:
    """A program, a count or a time: whole seconds have no point."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def shown(value: Any) -> str:
    """The value of a parameter, as in a program."""
    return value if isinstance(value, str) else text(value)
