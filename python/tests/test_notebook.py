"""The extension of IPython: cells, errors in place, results that show themselves, progress."""

import base64
import io
import json
import re
import shutil
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcadlang

pytest.importorskip("IPython")

from pcadlang import notebook
from pcadlang.notebook import cells, html, magic, progress, widget

LINE = """data xs;
assume m ~ normal(0, 10) #centre;
observe normal(m, 1) = xs as x;
"""
BALL = """include "std/scene.pcad" as scene;
assume size ~ uniform(0.5, 1.5);
assume view = scene.render(scene.affine(scale = size) * scene.sphere(1));
observe normal(size, 0.1) = 1;"""
ROOT = Path(__file__).parents[2]


@pytest.fixture
def shell() -> Iterator[Any]:
    """A shell with the extension."""
    from IPython.core.interactiveshell import InteractiveShell

    shell: Any = InteractiveShell.instance()
    notebook.load_ipython_extension(shell)
    yield shell
    shell.reset()
    InteractiveShell.clear_instance()


@pytest.fixture
def trace() -> pcadlang.Trace:
    """A ball of radius 1."""
    return pcadlang.Program.parse(BALL).compile().generate({"size": 1.0})[0]


def run(shell: Any, text: str) -> BaseException | None:
    """Runs a cell, and returns what it raised."""
    done = shell.run_cell(text)
    error: BaseException | None = done.error_before_exec or done.error_in_exec
    return error


def shown(shell: Any, value: Any) -> dict[str, Any]:
    """What a notebook is sent for a value."""
    data: dict[str, Any] = shell.display_formatter.format(value)[0]
    return data


def decoded(data: str | bytes) -> np.ndarray:
    """The pixels of a PNG file."""
    image = pytest.importorskip("PIL.Image")
    data = base64.b64decode(data) if isinstance(data, str) else data
    return np.asarray(image.open(io.BytesIO(data)))


def test_a_cell_binds_a_program(shell: Any) -> None:
    shell.user_ns["table"] = {"a b": [1.0, 2.0]}
    assert run(shell, f'%%pcad line --observe xs = table["a b"]\n{LINE}') is None
    made = shell.user_ns["line"]
    assert isinstance(made, pcadlang.Program) and made.text.strip() == LINE.strip()
    posterior = made.compile().sample(steps=2000, seed=1)
    assert posterior["m"].mean() == pytest.approx(1.5 * 2 / 2.01, abs=0.1)


def test_options_are_expressions_of_python(shell: Any) -> None:
    host = pcadlang.Host()
    host.function("twice", lambda x: 2 * x, {"x": "number"})
    shell.user_ns.update(host=host, k=4)
    text = "param n = 1;\nassume a ~ normal(twice(n), 0.001);\nobserve normal(a, 1) = 0;"
    # Not what IPython makes of braces elsewhere.
    assert run(shell, f"%%pcad p --host host --set n=sum({{k}}) + 1\n{text}") is None
    trace = shell.user_ns["p"].compile().simulate(seed=1)
    assert trace["a"] == pytest.approx(10, abs=0.01)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "a name"),
        ("--set a=1", "a name"),
        ("class", "a name"),
        ("p --sett a=1", "unknown option --sett"),
        ("p --set a", "NAME=VALUE"),
        ("p --observe a == 1", "NAME=VALUE"),
    ],
)
def test_mistakes_in_the_line_show_its_usage(shell: Any, line: str, said: str) -> None:
    from IPython.core.error import UsageError

    error = run(shell, f"%%pcad {line}\nassume a ~ normal(0, 1);")
    assert isinstance(error, UsageError) and said in str(error) and "%%pcad NAME" in str(error)


def test_errors_are_shown_in_place(shell: Any, capsys: pytest.CaptureFixture[str]) -> None:
    shell.user_ns["p"] = "an earlier program"
    error = run(shell, "%%pcad p\nlet a = 1;\nlet b = norml(a);")
    assert isinstance(error, magic.ProgramError)
    out = "".join(capsys.readouterr())
    plain = re.sub(r"\x1b\[[0-9;]*m", "", out)
    # The line of the magic is the cell's first.
    assert "%%pcad p:3:9" in plain and "did you mean `norm`?" in plain
    assert "Traceback" not in plain and "magic.py" not in plain
    [row] = [r for r in plain.splitlines() if "^" in r]
    [excerpt] = [r for r in plain.splitlines() if "norml(a)" in r and "│" in r]
    assert row.index("^") == excerpt.index("norml") and row.count("^") == len("norml")
    assert "\x1b[31m^^^^^" in out
    # What is under the name is no longer that of the cell.
    assert "p" not in shell.user_ns


def test_data_may_be_given_later_but_mistakes_may_not(shell: Any) -> None:
    assert run(shell, f"%%pcad line\n{LINE}") is None
    with pytest.raises(pcadlang.Error, match="xs"):
        shell.user_ns["line"].compile()
    assert isinstance(run(shell, f"%%pcad line\n{LINE}let z = q;"), magic.ProgramError)
    # Mistakes that only the data show are found with the data.
    text = LINE.replace("= xs as", "= xs.y as")
    assert run(shell, f"%%pcad line\n{text}") is None
    assert isinstance(run(shell, f"%%pcad line --observe xs=[1]\n{text}"), magic.ProgramError)


def test_errors_of_python_in_the_line_are_those_of_python(shell: Any) -> None:
    assert isinstance(run(shell, f"%%pcad line --observe xs=nowhere\n{LINE}"), NameError)


def test_a_posterior_is_a_table_with_marks(shell: Any) -> None:
    program = pcadlang.Program.parse(LINE).observe(xs=[1.0, 2.0])
    good = program.compile().sample(chains=4, steps=4000, seed=1)
    text = shown(shell, good)["text/html"]
    assert "<td" in text and ">m<" in text and "R-hat" in text and "color:var" not in text
    bad = program.compile().sample(chains=4, steps=20, warmup=0, seed=1)
    assert "color:var(--jp-error-color1" in shown(shell, bad)["text/html"]
    assert "Warnings" in shown(shell, bad)["text/html"] and bad.warnings


def test_modes_are_listed(shell: Any) -> None:
    text = "assume x ~ normal(0, 10); observe normal(abs(x), 0.1) = 5;"
    plan = "infer { warmup 200 { drift(@x); } repeat 400 { drift(@x); } }"
    model = pcadlang.Program.parse(text).compile()
    posterior = model.sample(chains=6, plan=plan, seed=2)
    assert len(posterior.modes) == 2
    assert "The chains are in 2 modes" in shown(shell, posterior)["text/html"]


def test_pictures_are_those_of_the_view(shell: Any, trace: pcadlang.Trace) -> None:
    view = trace.view()
    np.testing.assert_array_equal(decoded(shown(shell, view)["image/png"]), view.overlay())
    text = shown(shell, trace)["text/html"]
    assert "@size" in text
    match = re.search(r"base64,([^\"]+)", text)
    assert match is not None
    picture = decoded(match[1])
    np.testing.assert_array_equal(picture, html.smaller(view.overlay()))
    posterior = pcadlang.Program.parse(BALL).compile().sample(chains=1, steps=10)
    assert "data:image/png" in shown(shell, posterior)["text/html"]


def test_results_are_shown_over_a_photograph(
    shell: Any, trace: pcadlang.Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    monkeypatch.setattr("pcadlang.notebook.photo.display", lambda shown: sent.append(shown.data))
    photo = np.full((64, 64, 3), 77, np.uint8)
    posterior = pcadlang.Program.parse(BALL).compile().sample(chains=1, steps=10)
    for result in (trace, trace.view(), posterior):
        notebook.show(result, photo)
        notebook.show(result)
    pictures = [decoded(m) for s in sent for m in re.findall(r"base64,([^\"]+)", s)]
    assert len(pictures) == 6
    # A corner, where nothing is drawn.
    corners = [tuple(p[2, 2]) for p in pictures]
    assert corners[::2] == [(77, 77, 77)] * 3 and (77, 77, 77) not in corners[1::2]
    with pytest.raises(TypeError, match="int"):
        notebook.show(3, photo)  # type: ignore[arg-type]


def test_a_program_is_shown_in_colours(shell: Any) -> None:
    text = shown(shell, pcadlang.Program.parse(LINE))["text/html"]
    assert '<span class="kd">assume</span>' in text and '<span class="nf">normal</span>' in text
    assert '<span class="nd">#centre</span>' in text


def test_a_solid_is_a_widget_or_a_picture(
    shell: Any, trace: pcadlang.Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    solid = trace.view().solid
    picture = decoded(shown(shell, solid)["image/png"])
    drawn = (picture.min(axis=2) < 220).any(axis=0)
    # It fills the picture, with a margin.
    assert 0.85 < drawn.mean() < 0.97
    pytest.importorskip("anywidget")
    assert "application/vnd.jupyter.widget-view+json" in shown(shell, solid)
    made = widget.widget(solid)
    vertices, triangles = solid.mesh()
    np.testing.assert_array_equal(np.frombuffer(made.vertices, "<f4").reshape(-1, 3), vertices)
    np.testing.assert_array_equal(np.frombuffer(made.triangles, "<u4").reshape(-1, 3), triangles)
    # It needs no network: the addresses are names of HTML and SVG.
    addresses = set(re.findall(r"https?://[^\"'`]*", made._esm))
    assert addresses <= {"http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"}
    assert not re.search(r"\bfrom *[\"']|\bimport[ (\"']", made._esm)
    monkeypatch.setattr(widget, "widget_class", _missing)
    assert set(shown(shell, solid)) == {"text/plain", "image/png"}


def _missing() -> None:
    raise ImportError("anywidget")


class Outputs:
    """What a page is told: texts by the identity of their output."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.texts: list[list[str]] = []
        monkeypatch.setattr(progress, "display", self.display)

    def display(self, shown: Any, *, display_id: bool) -> Any:
        """An output appears."""
        assert display_id
        texts = [shown.data]
        self.texts.append(texts)

        class Handle:
            def update(self, shown: Any) -> None:
                texts.append(shown.data)

        return Handle()


def test_progress_changes_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    outputs = Outputs(monkeypatch)
    model = pcadlang.Program.parse(LINE).observe(xs=[1.0]).compile()
    posterior = notebook.sample(model, steps=10**9, time=1.2, seed=1)
    assert not posterior.interrupted and len(posterior.names) == 1
    # A program without a view has one output only.
    [texts] = outputs.texts
    assert 3 <= len(texts) <= 9
    assert "<progress" in texts[-2] and "best log joint" in texts[-2]
    assert re.fullmatch(r"done in 1\.[0-9] s", texts[-1])


def test_the_best_scene_is_drawn_while_a_cell_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    outputs = Outputs(monkeypatch)
    model = pcadlang.Program.parse(BALL).compile()
    photo = np.full((64, 64, 3), 77, np.uint8)
    notebook.sample(model, photo=photo, every=0.1, steps=10**9, time=1.5, chains=1, seed=1)
    assert len(outputs.texts) == 2
    pictures = next(texts for texts in outputs.texts if "<img" in texts[0])
    drawn = [decoded(m) for text in pictures for m in re.findall(r"base64,([^\"]+)", text)]
    assert drawn and all(tuple(p[2, 2]) == (77, 77, 77) for p in drawn)
    assert any((p != 77).any() for p in drawn)
    # The posterior shows itself: what is left is the line.
    assert pictures[-1] == ""
    outputs.texts.clear()
    notebook.sample(model, every=None, steps=10**9, time=0.5, chains=1, seed=1)
    assert "<img" not in str(outputs.texts)


def test_interrupting_the_kernel_keeps_the_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    outputs = Outputs(monkeypatch)
    begun = time.monotonic()

    def interrupted(self: Any, counts: Any) -> None:
        if counts["steps"] > 100 and time.monotonic() > begun + 0.3:
            raise KeyboardInterrupt

    monkeypatch.setattr(progress.Progress, "__call__", interrupted)
    model = pcadlang.Program.parse(LINE).observe(xs=[1.0]).compile()
    posterior = notebook.sample(model, steps=10**9, warmup=10, seed=1)
    assert posterior.interrupted and posterior["m"].size > 0
    assert outputs.texts[-1][-1].startswith("<div>interrupted after 0.")


@pytest.mark.parametrize(
    ("counts", "limit", "expected"),
    [
        ({"started": 0}, None, None),
        ({"started": 4, "warming": 1, "pass": 50, "passes": 100}, None, None),
        ({"started": 4, "pass": 50, "passes": 100}, None, 0.5),
        ({"started": 3, "ended": 2, "pass": 50, "passes": 100}, None, 0.625),
        ({"started": 4, "warming": 4, "seconds": 3.0}, 12.0, 0.25),
        ({"started": 4, "seconds": 30.0}, 12.0, 1.0),
    ],
)
def test_the_bar_is_what_is_known(
    counts: dict[str, Any], limit: float | None, expected: float | None
) -> None:
    zero = {"chains": 4, "ended": 0, "warming": 0, "pass": 0, "passes": 0, "seconds": 0.0}
    assert progress.fraction({**zero, **counts}, limit) == expected


def test_png_files_are_exact() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (13, 7, 3), np.uint8)
    data = html.png(pixels)
    assert struct.unpack(">II", data[16:24]) == (7, 13)
    assert zlib.crc32(data[12:29]) == struct.unpack(">I", data[29:33])[0]
    np.testing.assert_array_equal(decoded(data), pixels)
    assert html.smaller(np.zeros((1300, 10, 3), np.uint8)).shape == (433, 3, 3)


def test_the_lexer_knows_all_words_and_loses_no_text() -> None:
    from pygments.token import (  # type: ignore[import-untyped]
        Error,
        Keyword,
        Name,
        Operator,
        String,
    )

    from pcadlang.notebook.lexer import PcadLexer

    lexer = PcadLexer()
    for path in sorted((ROOT / "programs").glob("*.pcad")):
        text = path.read_text(encoding="utf-8")
        tokens = list(lexer.get_tokens(text))
        assert "".join(t for _, t in tokens).strip("\n") == text.strip("\n")
        assert not [t for kind, t in tokens if kind in Error]
    text = 'assume forest ~ flip(0.5) #a:b; mh(one(@x/y[0] + $a)); /* for\n*/ "if \\" // x" and'
    kinds = {t: kind for kind, t in lexer.get_tokens(text)}
    assert kinds["assume"] in Keyword and kinds["forest"] is Name and kinds["flip"] is Name.Function
    assert kinds["@x/y[0]"] is Name.Label and kinds["#a:b"] is kinds["$a"] is Name.Decorator
    assert kinds["and"] is Operator.Word and kinds[" // x"] in String


def test_the_scripts_are_complete(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node to check the syntax")
    for name, source in [("cells.js", cells.script()), ("widget.mjs", widget.script())]:
        (tmp_path / name).write_text(source, encoding="utf-8")
        subprocess.run([node, "--check", tmp_path / name], check=True)


def test_the_extension_can_be_unloaded(shell: Any, trace: pcadlang.Trace) -> None:
    notebook.unload_ipython_extension(shell)
    assert set(shown(shell, trace)) == {"text/plain"}
    assert set(shown(shell, trace.view().solid)) == {"text/plain"}
    assert run(shell, "%%pcad p\nassume a ~ normal(0, 1);") is not None


def test_neither_ipython_nor_anywidget_is_imported_before_it_is_needed() -> None:
    code = (
        "import sys, pcadlang.notebook\n"
        "print([m for m in ('IPython', 'anywidget', 'pygments', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_notebooks_are_without_outputs() -> None:
    paths = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))
    assert len(paths) == 5
    for path in paths:
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs") and cell.get("execution_count") is None, path.name
