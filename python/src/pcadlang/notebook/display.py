"""How results show themselves."""

import html
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pcadlang._native import Error, Posterior, Program, Trace, View
from pcadlang.notebook.html import image, items, number, png, table, value

MOST = 20
"""Rows of a table that are shown."""

COLUMNS = ("mean", "sd", "q05", "q95")
HEADS = ("", "mean", "sd", "5 %", "95 %", "ESS", "R-hat")

# The limits of Vehtari et al. 2021, per chain 100 effective draws.
R_HAT, ESS = 1.01, 400.0

Photo = NDArray[np.uint8]


def overlay(trace: Trace, photo: Photo | None = None) -> Photo | None:
    """The trace's view over a photograph; None if the program has no view."""
    try:
        view = trace.view()
    except Error:
        return None
    # The photograph that was observed, if the trace knows it.
    photo = getattr(trace, "photo", None) if photo is None else photo
    return view.overlay(photo)


def more(rows: list[Any]) -> str:
    """What is said of rows that are left out."""
    return f"<div>… and {len(rows) - MOST} more</div>" if len(rows) > MOST else ""


def summary_html(posterior: Posterior) -> str:
    """The table of quantities, those that have not converged marked."""
    rows, marked = [], set()
    for i, (name, all_of) in enumerate(posterior.summary().items()):
        s: dict[str, float | None] = {**all_of}  # type: ignore[dict-item]
        r_hat, ess = s["r_hat"], s["ess_bulk"]
        checks = [number(ess, ".0f"), number(r_hat, ".3f")]
        rows.append([name, *(number(s[c]) for c in COLUMNS), *checks])
        # A constant has no R-hat, and converges.
        if r_hat is not None and (r_hat > R_HAT or (ess is not None and ess < ESS)):
            marked.add(i)
    return table(HEADS, rows[:MOST], marked) + more(rows)


def modes_html(posterior: Posterior) -> str:
    """The table of modes, if there are several."""
    modes = posterior.modes
    if not modes:
        return ""
    names = [n for n in modes[0]["quantities"] if n != "log_joint"][:4]
    rows = [
        [
            ", ".join(map(str, mode["chains"])),
            number(mode["probability"], ".3f"),
            number(mode["log_joint"]),
            *(number(mode["quantities"].get(n, [None])[0]) for n in names),
        ]
        for mode in modes
    ]
    head = ["chains", "probability", "mean log joint", *names]
    return f"<div><b>The chains are in {len(modes)} modes</b></div>" + table(head, rows)


def posterior_html(posterior: Posterior, photo: Photo | None = None) -> str:
    """A posterior: its quantities, warnings, modes and the best state's picture."""
    names = posterior.names
    chains, draws = posterior[names[0]].shape[:2] if names else (0, 0)
    ended = ", interrupted" if posterior.interrupted else ""
    title = f"Posterior: {chains} chains x {draws} draws, {posterior.seconds:.1f} s{ended}"
    parts = [f"<div>{html.escape(title)}</div>"]
    try:
        picture = overlay(posterior.best, photo)
    except Error:  # The run made no step.
        picture = None
    if picture is not None:
        parts.append(image(picture, "the best state"))
    parts.append(summary_html(posterior))
    parts.append(items(posterior.warnings, "Warnings"))
    parts.append(modes_html(posterior))
    parts.append(items(posterior.approximations, "Approximate"))
    return "".join(parts)


def trace_html(trace: Trace, photo: Photo | None = None) -> str:
    """A trace: its choices with their scores, and its picture."""
    scores = trace.scores()
    rows = [[a, value(v), number(scores.get(a))] for a, v in trace.choices().items()]
    title = (
        f"log joint {number(trace.log_joint, '.6g')} = prior {number(trace.log_prior, '.6g')} + "
    )
    title += f"likelihood {number(trace.log_likelihood, '.6g')}"
    parts = [f"<div>{title}</div>", table(("choice", "value", "log density"), rows[:MOST])]
    parts.append(more(rows))
    picture = overlay(trace, photo)
    if picture is not None:
        parts.append(image(picture, "the scene"))
    return "".join(parts)


def view_png(view: View) -> bytes:
    """A view as a PNG file."""
    return png(view.overlay())


# The colours of the page's own editor, where it has any.
CODE_STYLE = """<style>
.pcad .k,.pcad .kd,.pcad .kc,.pcad .ow{color:var(--jp-mirror-editor-keyword-color,#008000)}
.pcad .c1,.pcad .cm{color:var(--jp-mirror-editor-comment-color,#408080);font-style:italic}
.pcad .s2,.pcad .se{color:var(--jp-mirror-editor-string-color,#ba2121)}
.pcad .m{color:var(--jp-mirror-editor-number-color,#666)}
.pcad .o{color:var(--jp-mirror-editor-operator-color,#7800c2)}
.pcad .nf{color:var(--jp-mirror-editor-def-color,#00f)}
.pcad .nl,.pcad .nd{color:var(--jp-mirror-editor-attribute-color,#00c)}
</style>"""


def program_html(program: Program) -> str:
    """The text of a program in colours."""
    from pygments import highlight  # type: ignore[import-untyped]
    from pygments.formatters import HtmlFormatter  # type: ignore[import-untyped]

    from pcadlang.notebook.lexer import PcadLexer

    formatter = HtmlFormatter(cssclass="pcad")
    return CODE_STYLE + str(highlight(program.text.strip("\n"), PcadLexer(), formatter))
