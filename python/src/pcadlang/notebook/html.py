"""Tables and pictures for outputs."""

import base64
import html
import math
import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST = 640
"""The longer side of shown pictures, in pixels: more only makes notebooks larger."""


def smaller(pixels: NDArray[np.uint8], longest: int = LONGEST) -> NDArray[np.uint8]:
    """A picture reduced to a longer side of at most `longest`, by means over squares."""
    by = math.ceil(max(pixels.shape[:2]) / longest)
    if by <= 1:
        return pixels
    height, width = (n // by for n in pixels.shape[:2])
    parts = pixels[: height * by, : width * by].reshape(height, by, width, by, -1)
    means: NDArray[np.float64] = parts.mean(axis=(1, 3))
    return means.round().astype(np.uint8)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A picture (height x width x 3 or 4 bytes) as a PNG file."""
    height, width, channels = pixels.shape
    # Each row as differences from the row above (filter 2), which compresses well.
    rows = pixels.reshape(height, -1)
    rows = np.diff(rows, axis=0, prepend=np.zeros_like(rows[:1]))
    data = np.concatenate([np.full((height, 1), 2, np.uint8), rows], axis=1)

    def chunk(name: bytes, content: bytes) -> bytes:
        check = zlib.crc32(name + content)
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", check)

    head = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    body = zlib.compress(data.tobytes(), 6)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def image(pixels: NDArray[np.uint8], alt: str) -> str:
    """A picture within HTML."""
    data = base64.b64encode(png(smaller(pixels))).decode()
    style = "max-width:100%;max-height:480px;display:block;margin:4px 0"
    return f'<img style="{style}" alt="{html.escape(alt)}" src="data:image/png;base64,{data}"/>'


def number(x: Any, form: str = ".4g") -> str:
    """A number in few digits; nothing if there is none."""
    if x is None or (isinstance(x, float) and math.isnan(x)):
        return ""
    return format(x, form)


def value(x: Any) -> str:
    """A value of the language in few characters."""
    if isinstance(x, bool | np.bool_):
        return str(bool(x)).lower()
    if isinstance(x, int | float | np.number):
        return number(float(x))
    if isinstance(x, np.ndarray) and x.size > 6:
        first = ", ".join(number(float(v), ".3g") for v in x.flat[:4])
        shape = " x ".join(map(str, x.shape))
        return f"[{first}, … ({shape})]"
    if isinstance(x, np.ndarray | list | tuple):
        return "[" + ", ".join(value(v) for v in x) + "]"
    text = x if isinstance(x, str) else repr(x)
    return text if len(text) <= 60 else text[:59] + "…"


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], marked: set[int] | None = None
) -> str:
    """A table. The first column is a name; cells are text; rows in `marked` stand out."""

    def line(cells: Sequence[str], tag: str, style: str = "") -> str:
        sides = ["left"] + ["right"] * (len(cells) - 1)
        inner = "".join(
            f'<{tag} style="text-align:{side};{style}">{html.escape(cell)}</{tag}>'
            for cell, side in zip(cells, sides, strict=True)
        )
        return f"<tr>{inner}</tr>"

    warn = "color:var(--jp-error-color1,#b00020);"
    body = "".join(
        line(row, "td", warn if i in (marked or ()) else "") for i, row in enumerate(rows)
    )
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"


def items(texts: Sequence[str], what: str) -> str:
    """A list under a heading; nothing if it is empty."""
    if not texts:
        return ""
    inner = "".join(f"<li>{html.escape(t)}</li>" for t in texts)
    return f"<div><b>{html.escape(what)}</b><ul>{inner}</ul></div>"
