"""The trade of speed for accuracy on a cluster: one task for each setting and case."""

import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcadlang.command import CommandError, Options
from pcadlang.ray import child, jobs
from pcadlang.ray.jobs import PathLike
from pcadlang.ray.settings import Setting, read

JOURNAL, WORK = "runs.jsonl", ".runs"
FOREVER = "999999999s"


@dataclass(frozen=True)
class Shared:
    """What all runs have in common."""

    program: str
    folder: Path
    out: Path
    seeds: int
    options: Options


@dataclass(frozen=True)
class Item:
    """What is run."""

    name: str
    setting: Setting
    case: str


def tradeoff(
    program: PathLike,
    *,
    cases: PathLike,
    out: PathLike,
    settings: PathLike | Sequence[PathLike] | None = None,
    seeds: int = 1,
    threads: int = 2,
    presets: PathLike | None = None,
    at_once: int | None = None,
    retries: int = jobs.RETRIES,
    progress: jobs.Watcher | None = None,
    **options: Any,
) -> Path:
    """Measures every setting on every case, on all nodes of a Ray cluster.

    The folder is that of `pcadlang.tradeoff`. Called again, it keeps the runs that are in it.
    Errors over time are those of the nodes that ran them, so these should be alike and idle.

    Args:
        program: The program's path, or the name of a shipped one.
        cases: The folder of cases. All nodes must see it under this path, as `out`.
        out: The folder for results.
        settings: Files of settings; by default PROG.settings.json.
        seeds: Runs of each setting on each case.
        threads: Threads of a run, and processors of its task.
        presets: A file for the front.
        at_once: Most tasks in flight; by default twice the cluster's room.
        retries: How often a task may lose its node.
        progress: Called for each task that ends or is lost.
        **options: Those of `pcadlang tradeoff`, but for `budget` and `jobs`.

    Returns:
        The folder.

    Raises:
        CommandError: if a setting or a case is wrong, or all runs failed.
    """
    folder, root = Path.cwd(), Path.cwd() / out
    if settings is None:
        settings = Path(program).with_suffix(".settings.json")
    files = (
        [Path(settings)] if isinstance(settings, str | os.PathLike) else list(map(Path, settings))
    )
    named = read(files)
    options |= {"cases": cases, "seeds": seeds, "threads": threads, "jobs": 1, "quiet": True}
    shared = Shared(os.fspath(program), folder, root, seeds, options)
    whole = {**options, "settings": files, "out": root, "presets": presets}
    measured = begin(shared, whole)
    known = {(r["setting"], r["case"], r["seed"]) for r in runs(root) if "failed" not in r}
    items = [Item(n, s, c) for c in measured for n, s in named.items()]
    todo = {f"{i.name} on {i.case}": i for i in items if not all_known(i, seeds, known)}
    fresh: dict[str, list[str]] = {}
    jobs.drive(
        run_setting,
        shared,
        todo,
        fresh.__setitem__,
        kept=len(items) - len(todo),
        cpus=threads,
        at_once=at_once,
        retries=retries,
        progress=progress,
    )
    keep(root, [line for key in todo for line in fresh[key]], known)
    child.call("tradeoff", [shared.program], {**whole, "budget": FOREVER}, folder)
    shutil.rmtree(root / WORK, ignore_errors=True)
    return root


def begin(shared: Shared, whole: Options) -> list[str]:
    """Lets the command check everything and open the folder; returns the cases, in its order."""
    try:
        child.call("tradeoff", [shared.program], {**whole, "budget": "0s"}, shared.folder)
    except CommandError as error:
        if "the budget ran out" not in str(error):
            raise
    cases: list[str] = json.loads((shared.out / "tradeoff.json").read_bytes())["cases"]
    return cases


def runs(root: Path) -> list[dict[str, Any]]:
    """The runs in a folder. A line that was cut off is none."""
    path = root / JOURNAL
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    return [json.loads(line) for line in lines if line.endswith("}")]


def all_known(item: Item, seeds: int, known: set[tuple[str, str, int]]) -> bool:
    """Whether a setting has been run on a case with every seed."""
    return all((item.name, item.case, seed) in known for seed in range(1, seeds + 1))


def keep(root: Path, lines: Sequence[str], known: set[tuple[str, str, int]]) -> None:
    """Adds new runs to the journal."""
    path = root / JOURNAL
    earlier = path.read_text("utf-8").splitlines() if path.exists() else []
    for line in lines:
        run = json.loads(line)
        if (run["setting"], run["case"], run["seed"]) not in known:
            earlier.append(line)
    jobs.write(path, "".join(line + "\n" for line in earlier if line).encode())


def run_setting(shared: Shared, item: Item) -> list[str]:
    """Runs a setting on a case; a task. Returns its lines of the journal."""
    key = f"{zlib.crc32(item.name.encode()):08x}-{item.case}-{shared.seeds}.jsonl"
    path = shared.out / WORK / key
    if path.exists():
        lines = path.read_text("utf-8").splitlines()
        if all(json.loads(line)["setting"] == item.name for line in lines):
            return lines
    with tempfile.TemporaryDirectory() as scratch:
        file, made = Path(scratch, "settings.json"), Path(scratch, "out")
        file.write_text(json.dumps({"base": item.setting}), "utf-8")
        options = {**shared.options, "settings": file, "only": item.case, "out": made}
        try:
            child.call("tradeoff", [shared.program], {**options, "budget": FOREVER}, shared.folder)
        except CommandError:
            # A run that fails is in the journal, too.
            if not runs(made):
                raise
        lines = (made / JOURNAL).read_text("utf-8").splitlines()
    jobs.write(path, "".join(line + "\n" for line in lines).encode())
    return lines
