"""The cases of a dataset, as the command finds them."""

import json
import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcadlang.command import CommandError

IMAGES = ("image.png", "image.jpg", "image.jpeg")


@dataclass(frozen=True)
class Case:
    """A picture, and what is known about it."""

    name: str
    image: str
    camera: str | None = None


def cases(dataset: Path, only: Collection[str] = ()) -> dict[str, Case]:
    """The cases of a dataset by name, or some of them.

    Raises:
        CommandError: if it has none, or not these.
    """
    people = dataset / "annotations.json"
    if people.is_file():
        listed = json.loads(people.read_text("utf-8"))["people"]
        found = [Case(p["id"], os.path.join(dataset, p["image"])) for p in listed]
    else:
        with os.scandir(dataset) as entries:
            names = sorted(e.name for e in entries if not e.name.startswith(".") and e.is_dir())
        found = [case for name in names for case in one(dataset / name)]
    known = {case.name: case for case in found}
    if len(known) < len(found) or not known:
        raise CommandError(f"{dataset}: no dataset, or one with a case that occurs twice")
    if missing := [name for name in only if name not in known]:
        raise CommandError(f"{dataset}: there is no case {missing[0]!r}")
    return {name: case for name, case in known.items() if not only or name in only}


def one(folder: Path) -> list[Case]:
    """The case in a folder, if it has a picture."""
    for image in IMAGES:
        if (folder / image).is_file():
            camera = folder / "camera.json"
            known = os.fspath(camera) if camera.is_file() else None
            return [Case(folder.name, os.fspath(folder / image), known)]
    return []


def detected(keypoints: Path | None) -> dict[str, Any]:
    """The entries of a file of detected keypoints, by case; those without any are left out."""
    if keypoints is None:
        return {}
    entries: dict[str, Any] = json.loads(keypoints.read_text("utf-8"))
    return {case: e for case, e in entries.items() if e.get("keypoints")}
