"""A dataset on a cluster: one task for each case."""

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pcadlang
from pcadlang.command import CommandError, Options
from pcadlang.ray import attempts, child, inputs, jobs
from pcadlang.ray.dataset import Case, cases, detected
from pcadlang.ray.jobs import PathLike

MARK = "evaluation.json"
WORK = ".attempts"


@dataclass(frozen=True)
class Shared:
    """What all cases have in common."""

    program: str
    dataset: str
    out: str
    folder: Path
    """The driver's folder, which relative paths start from."""
    options: Options
    items: Mapping[str, str]
    """The names of the program's `data` items by kind."""
    checkpoint: float


@dataclass(frozen=True)
class Item:
    """A case, and its entry in the file of keypoints."""

    case: Case
    keypoints: Any = None


def evaluate(
    program: PathLike,
    dataset: PathLike,
    *,
    out: PathLike,
    threads: int = 1,
    checkpoint: float = 10,
    at_once: int | None = None,
    retries: int = jobs.RETRIES,
    progress: jobs.Watcher | None = None,
    only: Sequence[str] = (),
    **options: Any,
) -> Path:
    """Runs a program on each picture of a dataset, on all nodes of a Ray cluster.

    The folder is that of `pcadlang.evaluate`, with the same draws if `steps` are given. Called
    again, it keeps the cases that are done and resumes the others from their checkpoints.

    Args:
        program: The program's path, or the name of a shipped one.
        dataset: The folder of the dataset. All nodes must see it under this path, as `out`.
        out: The folder for results.
        threads: Threads of a case, and processors of its task.
        checkpoint: Seconds between checkpoints: what a case loses if its node is lost.
        at_once: Most tasks in flight; by default twice the cluster's room.
        retries: How often a case may lose its node.
        progress: Called for each case that ends or is lost.
        only: These cases only.
        **options: Those of `pcadlang evaluate`, such as `steps=1000`, `seed=1`,
            `set={"size": 64}`, `keypoints="found.json"`.

    Returns:
        The folder.

    Raises:
        CommandError: if cases failed; all others are done.
    """
    root, folder = Path(out), Path.cwd()
    found = cases(Path(dataset), only)
    keypoints = options.get("keypoints")
    entries = detected(Path(keypoints) if keypoints else None)
    opened = pcadlang.Program.open(program, allow_read=options.get("allow_read") or ())
    items = {str(d["type"]): name for name, d in opened.data.items()}
    if "image" not in items:
        raise CommandError(f"{os.fspath(program)} observes no item of kind `image`")
    shared = Shared(
        os.fspath(program),
        os.fspath(dataset),
        os.fspath(out),
        folder,
        {**options, "threads": threads},
        items,
        checkpoint,
    )
    kept = begin(shared, found)
    todo = {n: Item(case, entries.get(n)) for n, case in found.items() if n not in kept}
    states = dict.fromkeys(kept, "done")
    jobs.drive(
        run_case,
        shared,
        todo,
        states.__setitem__,
        kept=len(kept),
        cpus=threads,
        at_once=at_once,
        retries=retries,
        progress=progress,
    )
    done = [name for name in found if states[name] == "done"]
    # Without `--only` the command would run failed cases again, here and one by one.
    part = bool(only) or len(done) < len(found)
    summarise(shared, done[:1] if part else [])
    shutil.rmtree(root / WORK, ignore_errors=True)
    if failed := [name for name in found if states[name] != "done"]:
        raise CommandError(f"{len(failed)} of {len(found)} cases failed: {', '.join(failed[:20])}")
    return root


def begin(shared: Shared, found: Mapping[str, Case]) -> set[str]:
    """Opens the folder, and returns the cases that are done in it."""
    root = Path(shared.out)
    if not (root / MARK).exists():
        if root.is_dir() and any(p.name != WORK for p in root.iterdir()):
            raise CommandError(f"{root} is not empty and is not the folder of an evaluation")
        jobs.write(root / MARK, b"{}")
    kept = {name for name in found if attempts.state(root / name) == "done"}
    if kept:
        # The command says if the settings have changed.
        summarise(shared, sorted(kept)[:1])
    for name in found:
        if name not in kept and (root / name).exists():
            aside = root / WORK / f"{name}.failed"
            shutil.rmtree(aside, ignore_errors=True)
            aside.parent.mkdir(exist_ok=True)
            os.rename(root / name, aside)
    return kept


def summarise(shared: Shared, only: Sequence[str]) -> None:
    """Lets the command write the summaries of what is in the folder."""
    options = {**shared.options, "out": shared.out, "only": ",".join(only) or None, "quiet": True}
    child.call("evaluate", [shared.program, shared.dataset], options, shared.folder)


def run_case(shared: Shared, item: Item) -> str:
    """Runs a case; a task. Returns `done` or `failed`."""
    # The folder has the driver's paths in it, as that of one machine.
    os.chdir(shared.folder)
    case, root = item.case, Path(shared.out)
    target, work = root / case.name, root / WORK / case.name
    if attempts.state(target) != "done":
        try:
            attempts.complete(work, target, lambda made: fill(shared, item, made))
        except CommandError:
            record_failure(shared, case.name, work, target)
    return attempts.state(target) or "failed"


def fill(shared: Shared, item: Item, made: Path) -> None:
    """Runs a case in a folder, or resumes it."""
    case, options = item.case, dict(shared.options)
    keypoints, camera = options.pop("keypoints", None), case.camera or options.get("camera")
    observe = [f"{shared.items['image']}={case.image}"]
    if item.keypoints is not None:
        observe.append(f"{shared.items['keypoints']}={keypoints}#{case.name}")
    options |= {"observe": observe, "camera": camera, "out": made, "keep": 0, "quiet": True}
    options |= {"resume": True, "checkpoint": f"{shared.checkpoint}s"}
    child.call("run", [shared.program], options, shared.folder)
    detector = inputs.edges(options.get("edges"))
    inputs.record(made / "run.json", inputs.hashed(case.image, camera, item.keypoints, detector))


def record_failure(shared: Shared, name: str, work: Path, target: Path) -> None:
    """Lets the command record why a case fails, as it does on one machine."""
    alone = work / "failed"
    shutil.rmtree(alone, ignore_errors=True)
    options = {**shared.options, "out": alone, "only": name, "quiet": True}
    try:
        child.call("evaluate", [shared.program, shared.dataset], options, shared.folder)
    except CommandError:
        if attempts.state(alone / name) is None:
            raise
    attempts.publish(alone / name, target)
    shutil.rmtree(work, ignore_errors=True)
