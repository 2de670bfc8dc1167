"""The dictionaries that the library returns, for type checkers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypedDict

if TYPE_CHECKING:
    from pcadlang._native import Trace


class Diagnostic(TypedDict):
    """A message about a program, with its place (lines and columns from 1)."""

    severity: Literal["error", "warning", "note"]
    message: str
    file: str | None
    line: int | None
    column: int | None
    hints: list[str]
    notes: list[str]


class Param(TypedDict):
    """A parameter of a program."""

    type: str | None
    default: str | None
    help: str | None


class Data(TypedDict):
    """A data item of a program."""

    type: str | None
    optional: bool
    help: str | None


class Progress(TypedDict, total=False):
    """How far a run is; `best` is there as often as `live` says, once there is a state."""

    chains: int
    steps: int
    started: int
    warming: int
    ended: int
    passes: int
    best_log_joint: float | None
    seconds: float
    best: Trace


class Summary(TypedDict):
    """The summary of one quantity; None where it is undefined."""

    mean: float | None
    sd: float | None
    q05: float | None
    q50: float | None
    q95: float | None
    mcse_mean: float | None
    mcse_sd: float | None
    ess_bulk: float | None
    ess_tail: float | None
    r_hat: float | None


class Why(TypedDict):
    """What a choice depends on, and what a change of it would affect."""

    origins: list[str]
    terms: list[dict[str, Any]]
    names: list[str]
    values: int
