"""What is written in Python and called by programs."""

import math

import numpy as np
import pytest

import pcadlang


def model(host: pcadlang.Host, text: str) -> pcadlang.Model:
    """Compiles a program that calls a host."""
    return pcadlang.Program.parse(text).host(host).compile()


def drag() -> pcadlang.Host:
    """A function with its derivative."""
    host = pcadlang.Host()
    host.function(
        "drag",
        lambda v: 0.6 * v * v,
        {"v": "number"},
        gradient=lambda a, _, by: [by * 1.2 * a[0]],
        about="The drag of a unit area.",
    )
    return host


def test_a_function_is_called_and_differentiated() -> None:
    text = """assume v ~ normal(10, 2); observe normal(drag(v), 1) = 55;
        infer { warmup 200 { hmc(@v); } repeat 500 { hmc(@v); } }"""
    posterior = model(drag(), text).sample(chains=2, seed=1)
    assert abs(posterior["v"].mean() - 9.57) < 0.05
    doc = drag().doc("drag")
    assert doc is not None and "The drag of a unit area." in doc


def test_mistakes_in_calls_are_those_of_the_language() -> None:
    with pytest.raises(pcadlang.Error, match="it takes v"):
        model(drag(), "let d = drag(w = 1);")
    with pytest.raises(pcadlang.Error, match="is a built-in of the language"):
        host = pcadlang.Host()
        host.function("sqrt", math.sqrt, {"x": "number"})
        model(host, "let d = 1;")


def test_arrays_records_and_defaults_cross() -> None:
    host = pcadlang.Host()
    host.function(
        "blend",
        lambda xs, r, k: {"sum": float(xs.sum()) * k, "m": np.outer(xs, xs), "b": r["b"]},
        {"xs": "array", "r": "record", "k": ("number", 2.0)},
    )
    text = (
        "let a = blend([1, 2], { b: true }); assume x ~ normal(a.sum, 1); observe normal(x, 1) = 0;"
    )
    trace = model(host, text).simulate()
    found = trace.value("a")
    assert found["sum"] == 6.0 and found["b"] is True
    np.testing.assert_array_equal(found["m"], [[1, 2], [2, 4]])


def test_an_exception_ends_the_run_and_is_the_cause() -> None:
    def fail(x: float) -> float:
        if x > 0.5:
            raise RuntimeError("too large")
        return x

    host = pcadlang.Host()
    host.function("odd", fail, {"x": "number"})
    text = "assume x ~ normal(0, 1); observe normal(odd(x), 1) = 1;"
    with pytest.raises(pcadlang.Error, match=r"<program>:1:\d+") as raised:
        model(host, text).sample(chains=1, steps=1000)
    assert isinstance(raised.value.__cause__, RuntimeError)
    assert "too large" in str(raised.value)


def test_outside_the_domain_proposals_are_rejected() -> None:
    def root(x: float) -> float:
        if x < 0:
            raise pcadlang.OutsideDomain("x must not be negative")
        return math.sqrt(x)

    host = pcadlang.Host()
    host.function("root", root, {"x": "number"})
    text = "assume x ~ normal(1, 1); observe normal(root(x), 0.5) = 1;"
    drawn = model(host, text).sample(chains=2, steps=2000, seed=1)["x"]
    assert drawn.min() >= 0 and 0.5 < drawn.mean() < 2


def laplace() -> pcadlang.Host:
    """A family of distributions."""
    host = pcadlang.Host()
    host.distribution(
        "my_normal",
        {"m": "number", "s": "number"},
        log_density=lambda x, m, s: (
            -0.5 * ((x - m) / s) ** 2 - math.log(s * math.sqrt(2 * math.pi))
        ),
        sample=lambda rng, m, s: rng.normal(m, s),
        gradient=lambda x, m, s: (
            -(x - m) / s**2,
            [(x - m) / s**2, ((x - m) ** 2 / s**2 - 1) / s],
        ),
    )
    return host


def test_a_distribution_draws_scores_and_has_gradients() -> None:
    text = "assume x ~ my_normal(0, 1); observe my_normal(x, 0.5) = 2 as y;"
    same = text.replace("my_normal", "normal")
    a = model(laplace(), text).generate({"x": 0.3})[0]
    b = pcadlang.Program.parse(same).compile().generate({"x": 0.3})[0]
    assert a.log_joint == pytest.approx(b.log_joint, abs=1e-12)
    assert a.gradient(["x"])[0] == pytest.approx(b.gradient(["x"])[0], abs=1e-12)
    plan = "infer { warmup 200 { nuts(@x); } repeat 1000 { nuts(@x); } }"
    posterior = model(laplace(), text).sample(chains=2, seed=1, plan=plan)
    assert abs(posterior["x"].mean() - 1.6) < 0.1


def test_supports_bound_what_is_drawn() -> None:
    host = pcadlang.Host()
    host.distribution(
        "triangle",
        {"w": "number"},
        log_density=lambda x, w: math.log(2 * (w - x) / w**2) if x < w else -math.inf,
        sample=lambda rng, w: w * (1 - math.sqrt(rng.uniform())),
        support=lambda w: ("interval", 0.0, w),
    )
    drawn = model(host, "assume x ~ triangle(3); observe normal(x, 10) = 0;").sample(
        chains=2, steps=3000, seed=1
    )["x"]
    assert drawn.min() >= 0 and drawn.max() <= 3 and abs(drawn.mean() - 1.0) < 0.1
    host = pcadlang.Host()
    host.distribution("bad", {}, log_density=lambda x: 0.0, sample=lambda rng: 7.0, support="unit")
    with pytest.raises(pcadlang.Error) as raised:
        model(host, "assume x ~ bad(); observe normal(x, 1) = 0;").simulate()
    assert "outside of its support" in str(raised.value.__cause__)


def test_a_likelihood_with_a_gradient_agrees_with_the_languages_own() -> None:
    host = pcadlang.Host()
    host.likelihood(
        "near",
        {"m": "number", "s": ("number", 0.5)},
        log_density=lambda y, m, s: float(-0.5 * (((y - m) / s) ** 2).sum()),
        gradient=lambda y, m, s: [float(((y - m) / s**2).sum()), None],
        sample=lambda y, rng, m, s: rng.normal(m, s, len(y)),
    )
    text = """data ys; assume m ~ normal(0, 10); observe near(m) = ys as seen;
        infer { warmup 300 { nuts(@m); } repeat 1000 { nuts(@m); } }"""
    ys = np.array([1.0, 2.0, 3.0])
    posterior = pcadlang.Program.parse(text).host(host).observe(ys=ys).compile().sample(seed=1)
    precision = 0.01 + 3 / 0.25
    assert posterior["m"].mean() == pytest.approx(ys.sum() / 0.25 / precision, abs=0.03)
    assert posterior["m"].std() == pytest.approx(precision**-0.5, abs=0.03)


def test_a_comparator_looks_at_views_and_gives_their_derivatives() -> None:
    def area(wanted: float, view: pcadlang.View, sd: float) -> float:
        return -0.5 * ((float(view.mask(64).sum()) - wanted) / sd) ** 2

    def slope(wanted: float, view: pcadlang.View, sd: float) -> list[object]:
        mask = view.mask(64)
        each = (wanted - mask.sum()) / sd**2
        return [view.by_mask(np.full(mask.shape, each), 64), None]

    host = pcadlang.Host()
    host.likelihood(
        "area", {"view": "view", "sd": ("number", 20.0)}, log_density=area, gradient=slope
    )
    text = """include "std/scene.pcad" as scene;
        assume size ~ uniform(0.3, 2);
        assume view = scene.render(scene.affine(scale = size) * scene.sphere(1));
        observe area(view) = 800 as seen;
        infer { warmup 60 { hmc(@size, steps = 3); slice(@size); }
                repeat 60 { hmc(@size, steps = 3); slice(@size); } }"""
    compiled = model(host, text)
    posterior = compiled.sample(chains=2, seed=1)
    assert posterior.best.view().mask(64).sum() == pytest.approx(800, abs=40)
    # The number of covered pixels is a step function: its slope over a tenth of the scale.
    trace = compiled.generate({"size": 1.2})[0]
    at, ends = trace.coordinates(["size"]), []
    for h in (-0.05, 0.05):
        weight = trace.propose_coordinates(["size"], at + h)
        ends.append(trace.log_joint + weight.log_jacobian)
        trace.rollback()
    assert trace.gradient(["size"])[0] == pytest.approx((ends[1] - ends[0]) / 0.1, rel=0.3)


def test_a_kernel_moves_the_trace() -> None:
    seen = []

    def walk(trace: pcadlang.Trace, rng: np.random.Generator, at: list[str], sd: float) -> bool:
        seen.append(trace)
        address = at[rng.integers(len(at))]
        weight = trace.propose({address: trace[address] + rng.normal(0, sd)})
        if math.log(rng.uniform()) < weight.log_weight:
            trace.commit()
            return True
        return False

    host = pcadlang.Host()
    host.kernel("walk", walk, {"at": "selection", "sd": ("number", 0.7)})
    text = """assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
        infer { warmup 100 { walk(@x); } repeat 5000 { walk(@x); } }"""
    posterior = model(host, text).sample(chains=2, seed=1)
    assert posterior["x"].mean() == pytest.approx(1.6, abs=0.08)
    assert 0 < posterior.kernels[0]["accepted"] < posterior.kernels[0]["proposals"]
    again = model(host, text).sample(chains=2, seed=1, threads=2)
    np.testing.assert_array_equal(again["x"], posterior["x"])
    # A trace that was lent is of no use when the step is over.
    with pytest.raises(RuntimeError, match="lent"):
        _ = seen[0].log_joint


def test_a_kernel_that_fails_ends_the_run() -> None:
    host = pcadlang.Host()
    host.kernel("broken", lambda trace, rng: bool(1 / 0), {})
    text = "assume x ~ normal(0, 1); observe normal(x, 1) = 0; infer { repeat 100 { broken(); } }"
    with pytest.raises(ZeroDivisionError):
        model(host, text).sample(chains=1)
