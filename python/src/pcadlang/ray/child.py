"""The command as a child of a task: it ends with the task, and with its node."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pcadlang.command import CommandError, Options, arguments
from pcadlang.ray.jobs import Lost, PathLike

# A worker that is killed cannot end its child: the system does (PR_SET_PDEATHSIG is 1). If the
# worker is gone before that is set, the child has another parent.
CODE = """
import os, signal, sys
parent = int(sys.argv.pop(1))
if sys.platform == "linux":
    import ctypes
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
if os.getppid() != parent:
    sys.exit(3)
from pcadlang.__main__ import main
sys.exit(main())
"""

MISTAKES = (1, 2)
"""Exit codes of errors in a program, its data or its options: they come again on any node."""


def call(name: str, positional: Sequence[PathLike], options: Options, folder: Path) -> str:
    """Runs a subcommand in a folder, and returns what it printed.

    Raises:
        CommandError: if it failed.
        Lost: if it was interrupted or killed.
    """
    line = [sys.executable, "-c", CODE, str(os.getpid()), name]
    line += [os.fspath(p) for p in positional] + arguments(options)
    done = subprocess.run(
        line, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False
    )
    if done.returncode in MISTAKES:
        raise CommandError(done.stderr.strip() or f"`{name}` ended with code {done.returncode}")
    if done.returncode != 0:
        raise Lost(f"`{name}` ended with code {done.returncode}: {done.stderr.strip()}")
    return done.stdout
