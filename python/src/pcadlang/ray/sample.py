"""Chains on a cluster: one task for each chain.

A chain depends on the program, its data, the seed and its number, so that it is the same on any
node. Compiled programs do not travel; each node compiles the program for itself.
"""

import json
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pcadlang
from pcadlang.command import CommandError
from pcadlang.ray import jobs
from pcadlang.ray.chains import Chain, Chains
from pcadlang.ray.jobs import PathLike


@dataclass(frozen=True)
class Recipe:
    """How to make a model, on any node."""

    program: str | None = None
    """The program's path, which all nodes must see, or the name of a shipped one."""
    text: str | None = None
    """A program's text, in place of a path."""
    params: Mapping[str, Any] = field(default_factory=dict)
    observe: Mapping[str, Any] = field(default_factory=dict)
    """Data: files, numbers, arrays."""
    camera: Any = None
    host: Callable[[], pcadlang.Host] | None = None
    """Makes the functions of Python that the program calls."""

    def compile(self) -> pcadlang.Model:
        """The model."""
        if self.text is not None:
            program = pcadlang.Program.parse(self.text)
        else:
            program = pcadlang.Program.open(self.program or "")
        if self.host is not None:
            program = program.host(self.host())
        program = program.set(**self.params)
        if self.camera is not None:
            program = program.camera(self.camera)
        return program.observe(**self.observe).compile()


@dataclass(frozen=True)
class Shared:
    """What all chains have in common."""

    recipe: Recipe
    settings: Mapping[str, Any]
    out: Path | None


def sample(
    recipe: Recipe,
    *,
    chains: int = 4,
    seed: int = 0,
    out: PathLike | None = None,
    at_once: int | None = None,
    retries: int = jobs.RETRIES,
    progress: jobs.Watcher | None = None,
    **settings: Any,
) -> Chains:
    """Runs chains on all nodes of a Ray cluster.

    The draws are those of `Model.sample` with as many chains, bit for bit, if their length is set
    by steps. With `time`, they depend on the nodes.

    Args:
        recipe: How to make the model.
        chains: The number of chains.
        seed: The random seed.
        out: A folder that all nodes share, for finished chains. Called again, it keeps them.
        at_once: Most chains in flight; by default twice the cluster's room.
        retries: How often a chain may lose its node.
        progress: Called for each chain that ends or is lost.
        **settings: Those of `Model.sample`: `steps`, `warmup`, `time`, `plan`.

    Returns:
        The draws of all chains; `pcadlang.to_arviz` takes them.

    Raises:
        CommandError: if the folder has chains of another model or other settings.
    """
    folder = Path(out).absolute() if out is not None else None
    settings = {**settings, "seed": seed}
    if folder:
        about = json.dumps({"model": recipe.compile().hash, **settings}, sort_keys=True).encode()
        mark = folder / "sample.json"
        if mark.exists() and mark.read_bytes() != about:
            raise CommandError(f"{folder} has chains of another model or other settings")
        jobs.write(mark, about)
    shared = Shared(recipe, settings, folder)
    ended: dict[str, Chain] = {}
    todo: dict[str, int] = {}
    for number in range(chains):
        kept = load(folder, number)
        if kept:
            ended[str(number)] = kept
        else:
            todo[str(number)] = number
    jobs.drive(
        run_chain,
        shared,
        todo,
        ended.__setitem__,
        kept=len(ended),
        at_once=at_once,
        retries=retries,
        progress=progress,
    )
    return Chains([ended[str(number)] for number in range(chains)], seed)


def file_of(folder: Path, number: int) -> Path:
    """The file of a chain."""
    return folder / f"chain-{number + 1}.pickle"


def load(folder: Path | None, number: int) -> Chain | None:
    """A chain that is in the folder."""
    if folder is None or not file_of(folder, number).exists():
        return None
    chain: Chain = pickle.loads(file_of(folder, number).read_bytes())
    return chain


def run_chain(shared: Shared, number: int) -> Chain:
    """Runs a chain; a task."""
    if kept := load(shared.out, number):
        return kept
    model = shared.recipe.compile()
    posterior = model.sample(chains=1, first_chain=number, threads=1, **shared.settings)
    best = posterior.best
    chain = Chain(posterior.groups(), best.save(), best.log_joint, posterior.seconds)
    if shared.out:
        jobs.write(file_of(shared.out, number), pickle.dumps(chain))
    return chain
