"""The draws of chains that ran on several nodes, as one posterior has them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pcadlang

Array = tuple[list[str], NDArray[Any]]
Groups = dict[str, dict[str, Array]]


@dataclass(frozen=True)
class Chain:
    """What a chain leaves."""

    groups: Groups
    best: str
    """Its best state, as `Trace.save` writes it."""
    log_joint: float
    """The log joint density of that state."""
    seconds: float


class Chains:
    """The draws of all chains, in the order of their numbers.

    `groups` and `[]` are those of `Posterior`, so that `pcadlang.to_arviz` takes it.
    """

    def __init__(self, chains: Sequence[Chain], seed: int) -> None:
        self.chains = list(chains)
        self.seed = seed

    @cached_property
    def _groups(self) -> Groups:
        return joined([chain.groups for chain in self.chains])

    def groups(self) -> Groups:
        """The groups of ArviZ's format: arrays by name, with the names of their dimensions."""
        return self._groups

    @property
    def names(self) -> list[str]:
        """The names of the recorded quantities."""
        return [name for name, (dims, _) in self._groups["posterior"].items() if len(dims) > 1]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The draws of a quantity: chains x draws, and its own dimension if it is a vector."""
        return self._groups["posterior"][name][1]

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def best(self, model: pcadlang.Model) -> pcadlang.Trace:
        """The best state of any chain."""
        return model.load(max(self.chains, key=lambda chain: chain.log_joint).best)


def joined(chains: Sequence[Groups]) -> Groups:
    """One set of groups from those of single chains."""
    all_groups: Groups = {}
    for group in dict.fromkeys(name for chain in chains for name in chain):
        parts = recoded([chain.get(group, {}) for chain in chains])
        names = dict.fromkeys(name for part in parts for name in part)
        draws = [part["draw"][1].shape[0] for part in parts if "draw" in part]
        even = min(draws, default=0)
        all_groups[group] = {name: join(name, parts, even) for name in names}
    return all_groups


def recoded(parts: Sequence[dict[str, Array]]) -> Sequence[dict[str, Array]]:
    """The same arrays, where texts have the same numbers in all chains (`NAME_level`)."""
    parts = [dict(part) for part in parts]
    for level in dict.fromkeys(n for part in parts for n in part if n.endswith("_level")):
        own = [part[level][1].tolist() if level in part else [] for part in parts]
        texts = list(dict.fromkeys(text for each in own for text in each))
        for part, each in zip(parts, own, strict=True):
            dims, codes = part.get(name := level.removesuffix("_level"), ([], np.empty(0)))
            if level in part and dims[:1] == ["chain"]:
                numbers = np.array([*map(texts.index, each), np.nan])
                known = np.where(np.isnan(codes), len(each), codes).astype(int)
                part[level] = [level], np.array(texts)
                part[name] = dims, numbers[known].astype(codes.dtype)
    return parts


def join(name: str, parts: Sequence[dict[str, Array]], even: int) -> Array:
    """An array of all chains.

    Under a time limit chains are cut to the length of the shortest. What a chain does not have, in
    a scene of another structure, is NaN.
    """
    present = [part[name] for part in parts if name in part]
    dims, first = present[0]
    if name == "chain":
        return dims, np.arange(len(parts), dtype=first.dtype)
    if dims == ["draw"]:
        return dims, first[:even]
    if dims[0] != "chain":
        # Coordinates, and observed data: the same for all, but for their length.
        return max(present, key=lambda array: array[1].shape)
    arrays = [array[:, :even] if dims[1:2] == ["draw"] else array for _, array in present]
    inner = tuple(np.max([array.shape[1:] for array in arrays], axis=0))
    if len(present) == len(parts) and all(array.shape[1:] == inner for array in arrays):
        return dims, np.concatenate(arrays)
    whole = np.full((len(parts), *inner), np.nan)
    rows = [i for i, part in enumerate(parts) if name in part]
    for row, array in zip(rows, arrays, strict=True):
        whole[row][tuple(slice(length) for length in array.shape[1:])] = array[0]
    return dims, whole
