"""Jobs of the command: runs with a folder, datasets, banks, the trade of speed for accuracy.

They run in a process of their own, so that Ctrl-C ends them as it ends the command, and their
memory is given back. Results are files, as the documentation of the command describes them.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

PathLike = str | os.PathLike[str]
Options = Mapping[str, Any]


class CommandError(RuntimeError):
    """A command failed; its text is what it printed."""


def arguments(options: Options) -> list[str]:
    """Options as the command has them: `{"time": "5s", "quiet": True}` is `--time 5s --quiet`.

    One letter is `-n`. A list repeats the option; `set={"size": 64}` is `--set size=64`. None
    and False leave it out.
    """
    out: list[str] = []
    for name, value in options.items():
        flag = f"-{name}" if len(name) == 1 else "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            out.append(flag)
        elif isinstance(value, Mapping):
            for key, one in value.items():
                out += [flag, f"{key}={one}"]
        elif isinstance(value, Sequence) and not isinstance(value, str):
            for one in value:
                out += [flag, str(one)]
        else:
            out += [flag, str(value)]
    return out


def call(name: str, positional: Sequence[PathLike], options: Options) -> str:
    """Runs a subcommand and returns what it printed.

    Raises:
        CommandError: if it failed; the text has its messages.
        KeyboardInterrupt: after Ctrl-C, once the command has written what it has.
    """
    line = [sys.executable, "-m", "pcadlang", name]
    line += [os.fspath(p) for p in positional] + arguments(options)
    with subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
    ) as process:
        try:
            out, errors = process.communicate()
        except KeyboardInterrupt:
            # In a terminal the process got it, too; from elsewhere it did not.
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise
    if process.returncode != 0:
        raise CommandError(errors.strip() or f"`{name}` ended with code {process.returncode}")
    return out


def run(program: PathLike, *, out: PathLike, **options: Any) -> dict[str, Any]:
    """Runs a program with a folder for its results, as `pcadlang run` does.

    Args:
        program: The program's path, or the name of a shipped one.
        out: The folder: draws, pictures, meshes, `report.html`, `inference.zarr`.
        **options: Those of the command, such as `observe="cup.png"`, `time="20s"`, `seed=1`.

    Returns:
        The summary that `--json` prints.
    """
    said: dict[str, Any] = json.loads(call("run", [program], {**options, "out": out, "json": True}))
    return said


def evaluate(program: PathLike, dataset: PathLike, *, out: PathLike, **options: Any) -> Path:
    """Runs a program on each picture of a dataset, as `pcadlang evaluate` does.

    Returns:
        The folder with the results: one folder a picture, and `results.json`.
    """
    call("evaluate", [program, dataset], {**options, "out": out})
    return Path(out)


def tradeoff(program: PathLike, *, out: PathLike, **options: Any) -> Path:
    """Measures the trade of speed for accuracy, as `pcadlang tradeoff` does.

    Returns:
        The folder with the measurements.
    """
    call("tradeoff", [program], {**options, "out": out})
    return Path(out)


def learn(program: PathLike, *, out: PathLike, **options: Any) -> Path:
    """Draws a bank of scenes from a program, as `pcadlang learn` does.

    Returns:
        The bank's file.
    """
    call("learn", [program], {**options, "out": out})
    return Path(out)
