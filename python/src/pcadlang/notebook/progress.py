"""Progress of a run, and the best scene so far, in an output that changes in place."""

import html
import time
from collections.abc import Mapping
from typing import Any

from pcadlang._native import Model, Posterior
from pcadlang.notebook.display import Photo, overlay
from pcadlang.notebook.html import image, number
from pcadlang.notebook.lazily import display, markup
from pcadlang.notebook.photo import pixels
from pcadlang.types import Progress as Counts

TEXTS = 0.25
"""Seconds between two texts."""

SHARE = 4.0
"""After a picture, none is drawn for so many times as long as it took."""


class Output:
    """An output of a cell that is replaced in place. It appears with its first text."""

    def __init__(self) -> None:
        self.handle: Any = None

    def show(self, text: str) -> None:
        """Shows HTML instead of what was there."""
        if self.handle is not None:
            self.handle.update(markup(text))
        elif text:
            self.handle = display(markup(f"<div>{text}</div>"), display_id=True)


class Progress:
    """What `Model.sample` calls, about ten times a second, with counts and now and then a state."""

    def __init__(self, photo: Photo | None, limit: float | None) -> None:
        self.photo = photo
        self.limit = limit
        self.best: float | None = None
        self.next_text = self.next_picture = 0.0
        # The line of text changes more often than the picture, so each is an output of its own.
        self.text = Output()
        self.picture = Output()

    def __call__(self, counts: Counts) -> None:
        """Shows counts, and the picture of the best state if it is better than the last."""
        begun = time.monotonic()
        best = counts.get("best")
        if best is not None and best.log_joint != self.best and begun >= self.next_picture:
            self.best = best.log_joint
            picture = overlay(best, self.photo)
            if picture is not None:
                self.picture.show(image(picture, "the best state so far"))
            self.next_picture = time.monotonic() + SHARE * (time.monotonic() - begun)
        elif begun < self.next_text:
            return
        self.next_text = begun + TEXTS
        self.text.show(line(counts, self.limit))

    def end(self, posterior: Posterior) -> None:
        """Leaves one line: the posterior shows itself."""
        self.picture.show("")
        how = "interrupted after" if posterior.interrupted else "done in"
        self.text.show(f"{how} {posterior.seconds:.1f} s")


def fraction(counts: Mapping[str, Any], limit: float | None) -> float | None:
    """How much of a run is done, if that is known."""
    chains, passes = counts["chains"], counts["passes"]
    of_passes = float(counts["ended"])
    # Passes are those of the loop that one chain is in: in warm-up they say nothing of the whole.
    if passes and not counts["warming"]:
        of_passes += (counts["started"] - counts["ended"]) * counts["pass"] / passes
    of_time = counts["seconds"] / limit if limit else 0.0
    done = max(of_time, of_passes / chains)
    return min(done, 1.0) if done else None


def line(counts: Counts, limit: float | None) -> str:
    """Counts as a bar and a line of text."""
    chains, running = counts["chains"], counts["started"] - counts["ended"]
    if not counts["started"]:
        parts = ["choosing initial states"]
    else:
        warming = f" ({counts['warming']} in warm-up)" if counts["warming"] else ""
        parts = [f"chains: {running} running{warming}, {counts['ended']} of {chains} ended"]
    parts += [f"{counts['steps']:,} steps", f"{counts['seconds']:.0f} s"]
    if counts["started"] and counts["best_log_joint"] is not None:
        parts.append(f"best log joint {number(counts['best_log_joint'], '.6g')}")
    done = fraction(counts, limit)
    bar = "" if done is None else f'<progress max="1" value="{done:.3f}"></progress> '
    return bar + html.escape(" · ".join(parts))


def sample(
    model: Model, *, photo: Any = None, every: float | None = 1.0, **options: Any
) -> Posterior:
    """Runs `Model.sample` with its progress shown in the cell's output.

    Interrupting the kernel ends the run and keeps what was drawn.

    Args:
        model: What is run.
        photo: What the best scene so far is drawn over: a path, a picture of PIL or an array.
        every: Seconds between two pictures; None for none.
        **options: Those of `Model.sample`.
    """
    watch = Progress(pixels(photo), options.get("time"))
    posterior = model.sample(progress=watch, live=every, **options)
    watch.end(posterior)
    return posterior
