"""Wrong types, shapes, freed objects, threads: an exception at worst."""

import contextlib
import gc
import random
import resource
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcadlang

TEXT = """include "std/scene.pcad" as scene;
    data d = [1, 2];
    assume x ~ normal(0, 1); assume w ~ mv_normal([0, 0], [[1, 0], [0, 1]]); assume c ~ flip(0.5);
    assume view = scene.render(scene.affine(scale = 1 + 0.1 * exp(x)) * scene.sphere(1));
    observe normal(x + w[0] + sum(d), 1) = 1 as y;"""


def odd_values() -> list[Any]:
    """Values of which most fit nowhere."""
    nested: list[Any] = []
    for _ in range(500):
        nested = [nested]
    cycle: list[Any] = []
    cycle.append(cycle)
    return [
        None, True, 0, -1, 1.5, float("nan"), float("inf"), 2**70, "x", "@x", "", "\0", "é" * 1000,
        b"bytes", (), [], {}, {1: 2}, {"a": {"b": []}}, nested, cycle, object(), print, int, 1j,
        np.zeros(0), np.zeros((3, 0)), np.zeros((2, 2, 2)), np.array("text"), np.array([object()]),
        np.array([1, 2], "u1"), np.array([True]), np.float32(3), np.int64(4),
        np.arange(10)[::-2], np.asfortranarray(np.ones((3, 3))), np.array(5.0),
        np.ma.masked_array([1.0, 2.0], [False, True]), range(3), {1, 2}, iter([1]), Path("x"),
    ]  # fmt: skip


def test_any_value_in_any_argument_is_an_exception_at_worst() -> None:
    program = pcadlang.Program.parse(TEXT)
    model = program.compile()
    trace = model.simulate(seed=1)
    update = trace.update({"x": 0.0})
    view = trace.view()
    host = pcadlang.Host()
    posterior = model.sample(chains=1, steps=5)
    calls: list[Callable[[Any, Any], Any]] = [
        lambda a, b: pcadlang.Program.open(a),
        lambda a, b: pcadlang.Program.parse(a),
        lambda a, b: program.set(**{"p": a}),
        lambda a, b: program.observe(d=a).compile().simulate(),
        lambda a, b: program.camera(a),
        lambda a, b: program.host(a),
        lambda a, b: model.simulate(seed=a, index=b),
        lambda a, b: model.generate(a),
        lambda a, b: model.generate({"x": a, "w": b}),
        lambda a, b: model.load(a),
        lambda a, b: model.sample(chains=1, steps=2, plan=a),
        lambda a, b: trace[a],
        lambda a, b: trace.update({"x": a}),
        lambda a, b: trace.update({"w": a, "c": b}),
        lambda a, b: trace.update(a),
        lambda a, b: trace.propose({"x": a}),
        lambda a, b: trace.propose({"w": a}),
        lambda a, b: trace.propose_coordinates(["x"], a),
        lambda a, b: trace.gradient(a),
        lambda a, b: trace.score(a),
        lambda a, b: trace.undo(a),
        lambda a, b: trace.value(a),
        lambda a, b: trace.why(a),
        lambda a, b: trace.view(a),
        lambda a, b: a in trace,
        lambda a, b: posterior[a],
        lambda a, b: view.mask(a) if not isinstance(a, int) or a < 9000 else None,
        lambda a, b: view.overlay(a),
        lambda a, b: view.by_mask(a, 16),
        lambda a, b: view.by_contours(a, 16),
        lambda a, b: host.function("f", a, b),
        lambda a, b: host.function("f", print, {"x": a}),
        lambda a, b: host.likelihood("l", {}, log_density=a),
        lambda a, b: host.distribution("d", {}, log_density=a, sample=b, support=a),
        lambda a, b: host.kernel("k", a, b),
        lambda a, b: host.doc(a),
    ]
    values = odd_values()
    chosen = random.Random(1)
    raised = 0
    for call in calls:
        for a in values:
            try:
                call(a, chosen.choice(values))
            except Exception as e:
                raised += 1
                assert str(e) or type(e) in (KeyError, TypeError)
    assert raised > 500
    trace.undo(update)
    assert np.isfinite(trace.log_joint)


def test_what_python_code_returns_is_checked() -> None:
    texts = {
        "f": "assume x ~ normal(0, 1); observe normal(f(x), 1) = 1;",
        "d": "assume x ~ d(); observe normal(0, 1) = 1;",
        "l": "assume x ~ normal(0, 1); observe l(x) = 1;",
    }
    for value in odd_values():
        host = pcadlang.Host()
        host.function("f", lambda x, v=value: v, {"x": "number"})
        host.distribution("d", {}, log_density=lambda x, v=value: v, sample=lambda r, v=value: v)
        host.likelihood("l", {"x": "number"}, log_density=lambda y, x, v=value: v)
        for text in texts.values():
            with contextlib.suppress(pcadlang.Error, TypeError, ValueError, RecursionError):
                pcadlang.Program.parse(text).host(host).compile().sample(chains=1, steps=3)


def test_objects_outlive_what_they_came_from() -> None:
    model = pcadlang.Program.parse(TEXT).compile()
    trace = model.simulate(seed=1)
    view = trace.view()
    solid = view.solid
    coordinates = trace.coordinates(["x", "w"])
    del model, trace, view
    gc.collect()
    assert solid.mesh()[0].shape[1] == 3 and coordinates.shape == (3,)


def test_one_trace_in_many_threads_is_an_exception_at_worst() -> None:
    trace = pcadlang.Program.parse(TEXT).compile().simulate(seed=1)
    view = trace.view()
    failures: list[BaseException] = []

    def work(seed: int) -> None:
        chosen = random.Random(seed)
        for _ in range(100):
            try:
                trace.propose({"x": chosen.gauss(0, 1)})
                trace.commit()
                _ = trace.gradient(["x"])
                view.mask(16 + chosen.randrange(8))
            except RuntimeError as e:
                # Another thread has it.
                assert "borrowed" in str(e)
            except BaseException as e:
                failures.append(e)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert not failures, failures
    assert np.isfinite(trace.log_joint)


def grown(call: Callable[[], object], times: int) -> float:
    """How much the process grows by more calls, in KiB."""
    for _ in range(times // 5 + 5):
        call()
    gc.collect()
    before = rss()
    for _ in range(times):
        call()
    gc.collect()
    return rss() - before


def rss() -> float:
    """The resident memory of this process, in KiB."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 1024
    except OSError:
        pytest.skip("needs /proc")


def test_memory_is_flat_over_a_thousand_calls(images: Path) -> None:
    program = pcadlang.Program.parse(TEXT)
    model = program.compile()
    trace = model.simulate(seed=1)
    view = trace.view()
    posterior = model.sample(chains=1, steps=20)
    host = pcadlang.Host()
    host.function("f", lambda v: v, {"v": "number"})
    hosted = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(f(x), 1) = 1;")
    hosted_model = hosted.host(host).compile()
    photo = np.zeros((16, 16, 3), np.uint8)
    saved = trace.save()

    def failing() -> None:
        with pytest.raises(pcadlang.Error):
            pcadlang.Program.parse("let x = norml(0);").compile()

    calls: dict[str, Callable[[], object]] = {
        "parse": lambda: pcadlang.Program.parse(TEXT),
        "observe": lambda: pcadlang.Program.parse("data photo: image;").observe(photo=photo),
        "compile": lambda: program.set().compile(),
        "error": failing,
        "simulate": lambda: model.simulate(seed=2),
        "generate": lambda: model.generate({"x": 0.5}),
        "load": lambda: model.load(saved),
        "sample": lambda: model.sample(chains=1, steps=3, warmup=0),
        "update": lambda: trace.update({"x": 0.5}),
        "propose": lambda: trace.propose({"w": [0.1, 0.2]}),
        "gradient": lambda: trace.gradient(["x", "w"]),
        "choices": lambda: trace.choices(),
        "save": lambda: trace.save(),
        "why": lambda: trace.why("x"),
        "view": lambda: trace.view().mask(32),
        "mesh": lambda: view.solid.mesh(),
        "groups": lambda: posterior.groups(),
        "summary": lambda: posterior.summary(),
        "host": lambda: hosted_model.simulate(seed=1),
    }
    over = {name: kib for name, call in calls.items() if (kib := grown(call, 1000)) > 2048}
    # The allocator may keep a little; what grows a second time leaks.
    leaks = {name: kib for name in over if (kib := grown(calls[name], 1000)) > 2048}
    assert not leaks, f"KiB over 1,000 calls: {leaks}"
