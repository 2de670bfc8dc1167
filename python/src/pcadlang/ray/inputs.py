"""The hash of a case's inputs, as `evaluate` records it.

`evaluate` keeps a case if `run.json` has this hash. A task makes a case by `run`, which can resume
and records another one.
"""

import json
from pathlib import Path
from typing import Any

from pcadlang.ray import jobs

PRIME, MASK = 0x0100_0000_01B3, (1 << 64) - 1


def fnv1a(content: bytes) -> int:
    """The 64-bit FNV-1a hash."""
    h = 0xCBF2_9CE4_8422_2325
    for byte in content:
        h = ((h ^ byte) * PRIME) & MASK
    return h


def text(value: Any) -> str:
    """A value as compact JSON, with numbers as the command writes them."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{text(k)}:{text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(text, value)) + "]"
    if isinstance(value, float):
        number, _, power = repr(value).partition("e")
        return number + (f"e{int(power)}" if power else "")
    return json.dumps(value, ensure_ascii=False)


def edges(spec: str | None) -> bytes:
    """What `--edges` adds: the detector's file, and its options."""
    if spec is None:
        return b""
    file, _, options = (spec, "", "") if Path(spec).exists() else spec.partition(",")
    return Path(file.strip()).read_bytes() + options.strip().encode()


def hashed(image: str, camera: str | None, entry: Any, detector: bytes) -> str:
    """The hash of a case: picture, camera, its entry of the keypoints, contour detector."""
    content = Path(image).read_bytes() + (Path(camera).read_bytes() if camera else b"")
    content += text(entry).encode() if entry is not None else b""
    return f"{fnv1a(content + detector):016x}"


def record(path: Path, inputs: str) -> None:
    """Puts the hash into a `run.json`."""
    run = json.loads(path.read_bytes())
    run["inputs_hash"] = inputs
    jobs.write(path, json.dumps(run, indent=2, ensure_ascii=False).encode())
