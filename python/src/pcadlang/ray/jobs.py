"""What the jobs share: a loop that keeps a cluster busy, and files that appear whole.

A task is a function of its item alone, so that any node may do it, and do it again. The loop holds
few tasks in flight, and gives a task to another node if its own is lost. Tasks leave their results
in a folder that all nodes share; what is there already is not done again.
"""

import logging
import os
import time
import uuid
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import ray
from ray.exceptions import (
    LocalRayletDiedError,
    NodeDiedError,
    ObjectLostError,
    OutOfMemoryError,
    RayTaskError,
    WorkerCrashedError,
)

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")

PathLike = str | os.PathLike[str]

RETRIES = 10
"""How often a task may lose its node before that is an error: a task that kills nodes would go on
for ever otherwise."""

AHEAD = 2
"""Tasks in flight for each slot of the cluster: one runs, and the next one waits beside it."""

LOST = (
    LocalRayletDiedError,
    NodeDiedError,
    ObjectLostError,
    OutOfMemoryError,
    WorkerCrashedError,
)


class Lost(RuntimeError):  # noqa: N818
    """A task ended for a reason outside it, such as a signal; another node may do it."""


@dataclass(frozen=True)
class Progress:
    """What has just happened in a job."""

    key: str
    """The task that it happened to: a case, a chain, a range of scenes."""
    event: Literal["kept", "done", "lost"]
    """`kept`: its result was there already. `lost`: its node is gone, and it starts again."""
    done: int
    total: int
    running: int
    """Tasks in flight."""
    lost: int
    """Attempts lost so far, over all tasks."""
    node: str
    """The node that did it; empty if none."""
    seconds: float
    """The time since the job began."""


Watcher = Callable[[Progress], object]


def attempt(work: Callable[[S, T], R], shared: S, item: T) -> tuple[str, R]:
    """Does a task; runs on a node. Returns the node and the result."""
    return ray.get_runtime_context().get_node_id(), work(shared, item)


def drive(
    work: Callable[[S, T], R],
    shared: S,
    tasks: Mapping[str, T],
    take: Callable[[str, R], object],
    *,
    kept: int = 0,
    cpus: float = 1,
    at_once: int | None = None,
    retries: int = RETRIES,
    progress: Watcher | None = None,
) -> None:
    """Does tasks on the cluster.

    Args:
        work: An importable function of `shared` and a task's item.
        shared: What all tasks need; sent to each node once.
        tasks: Items by key.
        take: Called with each key and its result, in order of completion.
        kept: Tasks that were done before, for the counts of `progress`.
        cpus: Processors of a task.
        at_once: Most tasks in flight; by default as many as the cluster has room for, twice.
        retries: How often a task may lose its node.
        progress: Called for each task that ends or is lost.

    Raises:
        Lost: if a task lost its node too often.
        Exception: that of a task; the others are cancelled.
    """
    if not ray.is_initialized():
        ray.init(logging_level=logging.WARNING)
    # Ray's own retries would hide what was lost, and repeat a task that crashes its worker.
    remote: Any = ray.remote(num_cpus=cpus, max_retries=0)(attempt)
    common = ray.put(shared)
    waiting, running, lost = deque(tasks), dict[Any, str](), dict[str, int]()
    done, total, begun, room = kept, kept + len(tasks), time.monotonic(), Room(cpus, at_once)

    def tell(key: str, event: Literal["done", "lost"], node: str = "") -> None:
        if progress:
            seconds = time.monotonic() - begun
            count = sum(lost.values())
            progress(Progress(key, event, done, total, len(running), count, node, seconds))

    try:
        while waiting or running:
            while waiting and len(running) < room.tasks():
                key = waiting.popleft()
                running[remote.remote(work, common, tasks[key])] = key
            for ref in ended(list(running)):
                key = running.pop(ref)
                try:
                    node, result = ray.get(ref)
                except (*LOST, RayTaskError) as error:
                    if not is_lost(error):
                        raise
                    lost[key] = lost.get(key, 0) + 1
                    if lost[key] > retries:
                        raise Lost(
                            f"{key} was lost {lost[key]} times; the last: {error}"
                        ) from error
                    waiting.appendleft(key)
                    tell(key, "lost")
                    continue
                done += 1
                take(key, result)
                tell(key, "done", node)
    finally:
        for ref in running:
            ray.cancel(ref, force=True)


def ended(running: list[Any]) -> list[Any]:
    """Waits a second at most for a task to end, and returns all that have ended by then."""
    # Results stay where they are until they are taken one by one: a driver's store is small.
    ready, _ = ray.wait(running, timeout=1, fetch_local=False)
    if not ready:
        return []
    ready, _ = ray.wait(running, num_returns=len(running), timeout=0, fetch_local=False)
    return list(ready)


def is_lost(error: Exception) -> bool:
    """Whether a task failed because of where it ran."""
    return isinstance(getattr(error, "cause", error), (*LOST, Lost))


class Room:
    """How many tasks may be in flight; it grows when nodes join."""

    def __init__(self, cpus: float, at_once: int | None) -> None:
        self.cpus = cpus
        self.at_once = at_once
        self.known = 1
        self.asked = float("-inf")

    def tasks(self) -> int:
        """Most tasks in flight now. The cluster is asked once a second at most."""
        if self.at_once is not None:
            return max(1, self.at_once)
        if time.monotonic() - self.asked > 1:
            self.asked = time.monotonic()
            resources: Any = ray.cluster_resources
            slots = resources().get("CPU", 0) / self.cpus
            self.known = max(1, int(AHEAD * slots))
        return self.known


def write(path: Path, content: bytes) -> None:
    """Writes a file that is complete or absent, whatever happens."""
    path.parent.mkdir(parents=True, exist_ok=True)
    # Two nodes may write it at the same time: each has a name of its own.
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
