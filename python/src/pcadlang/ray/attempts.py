"""Attempts at a run: each has a folder of its own, and goes on from the checkpoint of another.

A node that was given up may still be at work. It writes into its own attempt, so that it spoils
nothing, and the first attempt that is complete becomes the result: renaming a folder to the name
of one that is not empty fails.
"""

import json
import os
import shutil
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pcadlang.command import CommandError

GROWING = ("chain-*.csv", "draws-*.csv")
WHOLE = ("run.json", "trajectory.jsonl", "traces.jsonl", "best.trace.json")


def state(folder: Path) -> str | None:
    """The state of the run in a folder: `running`, `done`, `failed`, `interrupted`."""
    try:
        run: Mapping[str, Any] = json.loads((folder / "run.json").read_bytes())
    except (OSError, ValueError):
        return None
    return run.get("state")


def complete(attempts: Path, target: Path, run: Callable[[Path], None]) -> None:
    """Makes the folder of a run, from the last checkpoint of earlier attempts.

    Args:
        attempts: A folder for attempts, on the same file system as the result.
        target: The folder to make.
        run: Fills a folder; if there is an earlier run in it, that is resumed.

    Raises:
        CommandError: if the run fails.
    """
    earlier = latest(attempts)
    try:
        made = attempts / uuid.uuid4().hex
        made.mkdir(parents=True)
        if earlier:
            take_up(earlier, made)
        run(made)
    except (CommandError, OSError):
        if state(target) == "done":
            return
        if not earlier:
            raise
        # A checkpoint may be damaged: the run begins anew, which gives the same draws.
        made = attempts / uuid.uuid4().hex
        made.mkdir(parents=True)
        run(made)
    publish(made, target)
    shutil.rmtree(attempts, ignore_errors=True)


def latest(attempts: Path) -> Path | None:
    """The attempt with the last checkpoint, if there is one."""
    written = [(p.stat().st_mtime_ns, p.parent) for p in attempts.glob("*/chain-*.checkpoint")]
    return max(written)[1] if written else None


def take_up(earlier: Path, made: Path) -> None:
    """Copies what a run resumes from. The earlier attempt may still be growing."""
    # Draws are written before the checkpoint that needs them, so they are copied after it.
    for pattern in ("chain-*.checkpoint", *WHOLE, *GROWING):
        for path in earlier.glob(pattern):
            shutil.copy2(path, made / path.name)


def publish(made: Path, target: Path) -> None:
    """Gives a complete attempt the name of the result, unless another was first."""
    try:
        os.rename(made, target)
    except OSError:
        if not target.is_dir():
            raise
