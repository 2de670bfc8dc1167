"""Executes the notebooks from empty, and takes the pictures out of their outputs.

python run.py [FOLDER] [--only NAME]

The executed notebooks and their pictures are written to the folder, by default a temporary one. A
cell that fails ends the program with code 1.
"""

import argparse
import base64
import re
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
IMAGE = re.compile(r'src="data:image/png;base64,([A-Za-z0-9+/=]+)"')


def execute(path: Path, timeout: int) -> tuple[Any, str | None]:
    """The notebook with outputs, and what failed, if anything did."""
    nbformat, nbclient = import_module("nbformat"), import_module("nbclient")
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    # The kernel of this very Python.
    client = nbclient.NotebookClient(
        notebook,
        timeout=timeout,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    )
    try:
        client.execute()
    except (
        nbclient.exceptions.CellExecutionError,
        nbclient.exceptions.CellTimeoutError,
        nbclient.exceptions.DeadKernelError,
    ) as e:
        return notebook, str(e)
    return notebook, None


def pictures(notebook: Any) -> list[bytes]:
    """The PNG files in a notebook's outputs, in their order."""
    found: list[bytes] = []
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            texts = [data["image/png"]] if "image/png" in data else []
            texts += IMAGE.findall(data.get("text/html", ""))
            found += [base64.b64decode(text) for text in texts]
    return found


def main() -> int:
    """Runs the notebooks.

    Returns:
        The number of notebooks that failed.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, help="where results are written")
    parser.add_argument("--only", default="", help="run the notebooks with this in their name")
    parser.add_argument("--timeout", type=int, default=300, help="seconds for one cell")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="notebooks-"))
    folder.mkdir(parents=True, exist_ok=True)
    nbformat = import_module("nbformat")
    failed = 0
    for path in sorted(HERE.glob("*.ipynb")):
        if given.only not in path.stem:
            continue
        begun = time.monotonic()
        notebook, mistake = execute(path, given.timeout)
        nbformat.write(notebook, folder / path.name)
        all_of = pictures(notebook)
        for i, picture in enumerate(all_of, 1):
            (folder / f"{path.stem}-{i:02}.png").write_bytes(picture)
        seconds = time.monotonic() - begun
        print(f"{path.name}: {seconds:.1f} s, {len(all_of)} pictures", flush=True)
        if mistake is not None:
            print(f"{path.name} failed:\n{mistake}", file=sys.stderr)
            failed += 1
    print(f"results are in {folder}")
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
