"""A bank of scenes on a cluster: one task for each range of scenes."""

import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pcadlang
from pcadlang.command import CommandError, Options
from pcadlang.ray import child, jobs
from pcadlang.ray.jobs import PathLike


@dataclass(frozen=True)
class Shared:
    """What all ranges have in common."""

    program: str
    folder: Path
    shards: Path
    options: Options


def learn(
    program: PathLike,
    *,
    out: PathLike,
    n: int = 10_000,
    shard: int = 1000,
    threads: int = 1,
    at_once: int | None = None,
    retries: int = jobs.RETRIES,
    progress: jobs.Watcher | None = None,
    **options: Any,
) -> Path:
    """Draws a bank of scenes from a program, on all nodes of a Ray cluster.

    The file is that of `pcadlang.learn`, byte for byte. Called again, it keeps the ranges that
    are drawn.

    Args:
        program: The program's path, or the name of a shipped one.
        out: The bank. Ranges are drawn into the folder `OUT.shards` beside it, which all nodes
            must see under the same path.
        n: The number of scenes.
        shard: Scenes of a range: what is drawn again if a node is lost.
        threads: Threads of a range, and processors of its task.
        at_once: Most tasks in flight; by default twice the cluster's room.
        retries: How often a range may lose its node.
        progress: Called for each range that ends or is lost.
        **options: Those of `pcadlang learn`, such as `seed=1`, `features="contours"`.

    Returns:
        The bank.

    Raises:
        CommandError: if the program fails, or other scenes are in the folder.
    """
    path, folder = Path(out), Path.cwd()
    shards = folder / f"{path}.shards"
    options = {**options, "threads": threads}
    opened = pcadlang.Program.open(program, allow_read=options.get("allow_read") or ())
    about = {"program": opened.hash, "shard": shard, **{**options, "threads": None}}
    described = json.dumps(about, indent=2, sort_keys=True, default=str).encode()
    mark = shards / "learn.json"
    if mark.exists() and mark.read_bytes() != described:
        raise CommandError(f"{shards} has scenes of another program or other options")
    jobs.write(mark, described)
    shared = Shared(os.fspath(program), folder, shards, options)
    ranges = {name(a, b): (a, b) for a, b in cut(n, shard)}
    todo = {key: ends for key, ends in ranges.items() if not (shards / key).exists()}
    jobs.drive(
        draw,
        shared,
        todo,
        lambda key, _: None,
        kept=len(ranges) - len(todo),
        cpus=threads,
        at_once=at_once,
        retries=retries,
        progress=progress,
    )
    # From within their folder, so that the names of many thousands fit into a command.
    join = {"join": list(ranges), "out": folder / path, "quiet": True}
    child.call("learn", [program], join, shards)
    shutil.rmtree(shards)
    return path


def cut(n: int, shard: int) -> list[tuple[int, int]]:
    """Ranges of equal length, but for the last."""
    return [(a, min(a + shard, n)) for a in range(0, n, shard)]


def name(a: int, b: int) -> str:
    """The file of a range."""
    return f"{a}-{b}.bank"


def draw(shared: Shared, ends: tuple[int, int]) -> None:
    """Draws the scenes of a range; a task. The command writes the file atomically."""
    a, b = ends
    target = shared.shards / name(a, b)
    if target.exists():
        return
    made = shared.shards / f".{os.getpid()}-{os.urandom(8).hex()}"
    made.mkdir()
    try:
        options = {**shared.options, "first": a or None, "out": made / "bank", "quiet": True}
        child.call("learn", [shared.program, "-n", str(b - a)], options, shared.folder)
        (made / "bank").replace(target)
    finally:
        shutil.rmtree(made, ignore_errors=True)
