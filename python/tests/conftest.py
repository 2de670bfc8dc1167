"""What the tests share: data, and the command to compare with."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

IMAGES = Path(__file__).parents[2] / "examples" / "images"


@pytest.fixture
def images() -> Path:
    """The folder of example photographs."""
    return IMAGES


class Command:
    """The command, and the draws that it writes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, *arguments: object) -> None:
        """Runs a program into the folder."""
        line = [sys.executable, "-m", "pcadlang", "run", *map(str, arguments)]
        line += ["--quiet", "--out", str(self.folder)]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    def column(self, name: str) -> NDArray[np.float64]:
        """The draws of a column: chains x draws."""
        chains = []
        for path in sorted(self.folder.glob("chain-*.csv")):
            rows = csv.DictReader(line for line in path.open() if not line.startswith("#"))
            chains.append([float(row[name]) for row in rows])
        return np.array(chains)


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """The command, with a folder of its own."""
    return Command(tmp_path / "run")
