"""pcadlang: from a photograph back to a 3D scene by Bayesian inference.

    import pcadlang

    program = pcadlang.Program.open("lathe.pcad").observe(photo="cup.png")
    posterior = program.compile().sample(chains=4, time=20, seed=1)
    pcadlang.to_arviz(posterior)          # ArviZ's InferenceData
    posterior.best.view().overlay()       # a picture, as a numpy array

Programs, models, posteriors and traces are those of the library in Rust; see the documentation of
the project for the language. The same program, data, seed and steps give the same draws as the
command `pcadlang run`, bit for bit.
"""

from pcadlang._native import (
    Adjoint,
    Error,
    Host,
    Model,
    Object,
    OutsideDomain,
    Posterior,
    Program,
    Solid,
    Trace,
    Update,
    View,
    Weight,
    __version__,
)
from pcadlang.command import CommandError, evaluate, learn, run, tradeoff
from pcadlang.results import picture, to_arviz, to_trimesh
from pcadlang.types import Data, Diagnostic, Param, Progress, Summary, Why

__all__ = [
    "Adjoint",
    "CommandError",
    "Data",
    "Diagnostic",
    "Error",
    "Host",
    "Model",
    "Object",
    "OutsideDomain",
    "Param",
    "Posterior",
    "Program",
    "Progress",
    "Solid",
    "Summary",
    "Trace",
    "Update",
    "View",
    "Weight",
    "Why",
    "__version__",
    "evaluate",
    "learn",
    "picture",
    "run",
    "to_arviz",
    "to_trimesh",
    "tradeoff",
]


def load_ipython_extension(shell: object) -> None:
    """Loads the extension of `pcadlang.notebook`: `%load_ext pcadlang`."""
    from pcadlang.notebook import load_ipython_extension as load

    load(shell)
