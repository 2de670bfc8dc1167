"""Posteriors: the same draws as the command, and exact answers."""

import math
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import Command

import pcadlang

CONJUGATE = "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2 as y;"


def test_the_draws_are_those_of_the_command_bit_for_bit(command: Command, images: Path) -> None:
    for name, steps, photo, columns in [
        ("linreg.pcad", 300, None, ["slope", "noise"]),
        ("coin.pcad", 200, None, ["heads", "next"]),
        ("lathe.pcad", 12, "coffee_cup.png", ["H"]),
    ]:
        program = pcadlang.Program.open(name)
        line: list[object] = [name, "--seed", 5, "--chains", 2, "--steps", steps, "--warmup", 20]
        line += ["--overwrite"]
        if photo:
            program = program.set(tries=20, keep=2).observe(photo=images / photo)
            line += ["--observe", images / photo, "--set", "tries=20", "--set", "keep=2"]
        drawn = program.compile().sample(chains=2, steps=steps, warmup=20, seed=5)
        command.run(*line)
        for column in columns:
            # A word of R gets a `_` in the file.
            written = "next_" if column == "next" else column
            np.testing.assert_array_equal(drawn[column], command.column(written), err_msg=name)


def test_a_conjugate_posterior_is_exact() -> None:
    posterior = pcadlang.Program.parse(CONJUGATE).compile().sample(chains=4, steps=4000, seed=1)
    x = posterior.summary()["x"]
    # The precision is 1 + 4, the mean 4 * 2 / 5.
    assert x["mean"] is not None and x["sd"] is not None and x["mcse_mean"] is not None
    assert abs(x["mean"] - 1.6) < 5 * x["mcse_mean"]
    assert abs(x["sd"] - 5**-0.5) < 0.02


def test_an_enumerable_posterior_is_exact() -> None:
    text = """assume k ~ uniform_discrete(0, 5);
        assume c ~ flip(0.3);
        observe poisson(1 + k + (if c { 4 } else { 0 })) = 6 as n;"""
    posterior = pcadlang.Program.parse(text).compile().sample(chains=4, steps=20000, seed=2)
    weight = {}
    for k in range(6):
        for c in (0, 1):
            rate = 1 + k + 4 * c
            prior = 0.3 if c else 0.7
            weight[k, c] = prior * math.exp(6 * math.log(rate) - rate)
    total = sum(weight.values())
    for (k, c), w in weight.items():
        share = np.mean((posterior["k"] == k) & (posterior["c"] == c))
        assert abs(share - w / total) < 0.02, (k, c)


def test_a_circle_is_found_in_a_drawn_picture() -> None:
    text = """include "std/scene.pcad" as scene;
        data photo: image;
        assume size ~ uniform(0.5, 1.5);
        assume view = scene.render(scene.affine(scale = size) * scene.sphere(1));
        observe scene.contour(view, size = 64) = photo as seen;"""
    program = pcadlang.Program.parse(text)
    blank = np.zeros((128, 128, 3), np.uint8)
    blank[40:88, 40:88] = 255
    drawn = program.observe(photo=blank).compile().generate({"size": 1.0})[0].view()
    photo = np.where(drawn.mask(128)[..., None], np.uint8(230), np.uint8(20)).repeat(3, 2)
    posterior = program.observe(photo=photo).compile().sample(chains=2, steps=400, seed=3)
    assert abs(posterior["size"].mean() - 1.0) < 0.05


def test_groups_and_summaries_are_those_of_the_draws() -> None:
    text = "assume w ~ mv_normal([0, 0], [[1, 0], [0, 1]]); observe normal(w[0], 1) = [1, 2] as y;"
    posterior = pcadlang.Program.parse(text).compile().sample(chains=2, steps=50, seed=1)
    assert posterior.names == ["w"] and "w" in posterior
    chains, draws, elements = posterior["w"].shape
    assert (chains, elements) == (2, 2) and 40 <= draws <= 50
    groups = posterior.groups()
    assert set(groups) == {"posterior", "sample_stats", "log_likelihood", "observed_data"}
    assert groups["posterior"]["w"][0] == ["chain", "draw", "w_dim_0"]
    assert groups["log_likelihood"]["observation"][1].tolist() == ["y[0]", "y[1]"]
    mean = posterior.summary()["w[1]"]["mean"]
    assert mean == pytest.approx(posterior["w"][..., 1].mean(), rel=1e-12)
    assert posterior.kernels[0]["proposals"] > 0
    with pytest.raises(KeyError, match="there are: w"):
        posterior["z"]


def test_shapes_fields_and_texts_survive() -> None:
    text = """
    assume a ~ normal(0, 1);
    assume R = [[a, 1, 2], [3, 4, 5]];
    assume P = { x: a, y: 2 * a };
    assume parts = [{ r: 1, h: a }, { r: 2, h: 2 * a }, { r: 3, h: 3 * a }];
    assume kind = if a > 0 { "vase" } else { "cup" };
    """
    posterior = pcadlang.Program.parse(text).compile().sample(chains=2, steps=200, seed=1)
    a = posterior["a"]
    groups = posterior.groups()["posterior"]
    assert groups["R"][0] == ["chain", "draw", "R_dim_0", "R_dim_1"]
    np.testing.assert_array_equal(posterior["R"][..., 0, 0], a)
    np.testing.assert_array_equal(posterior["R"][..., 1, 2], 5)
    assert groups["P_field"][1].tolist() == ["x", "y"]
    np.testing.assert_array_equal(posterior["P"][..., 1], 2 * a)
    assert groups["parts"][0] == ["chain", "draw", "parts_dim_0", "parts_field"]
    np.testing.assert_array_equal(posterior["parts"][..., 2, 1], 3 * a)
    kinds = groups["kind_level"][1][posterior["kind"]]
    np.testing.assert_array_equal(kinds, np.where(a > 0, "vase", "cup"))
    assert "R[1,2]" in posterior.summary()


def test_arviz_has_the_same_numbers() -> None:
    arviz = pytest.importorskip("arviz")
    posterior = pcadlang.Program.parse(CONJUGATE).compile().sample(chains=4, steps=101, seed=1)
    data = pcadlang.to_arviz(posterior)
    np.testing.assert_array_equal(data.posterior["x"].values, posterior["x"])
    table = arviz.summary(data, round_to="none")
    ours = posterior.summary()["x"]
    theirs = {"mean": "mean", "sd": "sd", "ess_bulk": "ess_bulk", "r_hat": "r_hat"}
    for mine, name in theirs.items():
        assert float(table.loc["x", name]) == pytest.approx(ours[mine], rel=1e-9), name  # type: ignore[literal-required]
    assert arviz.loo(data).elpd_loo < 0


def test_the_best_state_and_the_last_ones_are_traces() -> None:
    posterior = pcadlang.Program.parse(CONJUGATE).compile().sample(chains=3, steps=500, seed=1)
    assert posterior.best.log_joint >= max(t.log_joint for t in posterior.last)
    assert posterior.best["x"] == pytest.approx(1.6, abs=0.1)
    assert len(posterior.last) == 3 and all(np.isfinite(t["x"]) for t in posterior.last)
    assert posterior.best.save() == posterior.best.save()


def test_another_plan_is_used_and_mistakes_in_it_are_shown() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    posterior = model.sample(chains=1, plan="infer { repeat 50 { slice(@x); } }")
    assert posterior["x"].shape == (1, 50) and posterior.kernels[0]["name"].startswith("slice")
    with pytest.raises(pcadlang.Error, match="did you mean `slice`"):
        model.sample(plan="infer { slize(@x); }")


def test_progress_is_reported_and_its_exceptions_are_raised() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    seen: list[int] = []
    model.sample(time=0.6, steps=10**9, progress=lambda p: seen.append(p["steps"]))
    assert len(seen) >= 2 and seen == sorted(seen)

    def fail(_: object) -> None:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        model.sample(steps=10**9, progress=fail)


def test_chains_can_be_spread_over_calls() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    together = model.sample(chains=3, steps=60, seed=4)["x"]
    apart = [model.sample(chains=1, first_chain=i, steps=60, seed=4)["x"] for i in range(3)]
    np.testing.assert_array_equal(np.concatenate(apart), together)


def test_the_best_state_so_far_is_shown_while_chains_run() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    best: list[float] = []

    def look(counts: pcadlang.Progress) -> None:
        if "best" in counts:
            best.append(counts["best"].log_joint)

    model.sample(time=0.8, steps=10**9, progress=look, live=0.15)
    assert len(best) >= 2 and best == sorted(best)


def test_two_programs_run_in_two_threads_and_python_goes_on() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    other = pcadlang.Program.parse(CONJUGATE.replace("= 2", "= -2")).compile()
    alone = [m.sample(chains=1, steps=20000, seed=7)["x"] for m in (model, other)]
    together: dict[int, object] = {}

    def work(i: int) -> None:
        together[i] = (model, other)[i].sample(chains=1, steps=20000, seed=7)["x"]

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for t in threads:
        t.start()
    ticks = 0
    while any(t.is_alive() for t in threads):
        ticks += 1
        for t in threads:
            t.join(0.001)
    assert ticks > 3
    for i in range(2):
        np.testing.assert_array_equal(together[i], alone[i])


def test_wrong_settings_are_errors() -> None:
    model = pcadlang.Program.parse(CONJUGATE).compile()
    for wrong in [{"chains": 0}, {"time": -1.0}, {"time": math.nan}]:
        with pytest.raises(ValueError):
            model.sample(**wrong)  # type: ignore[arg-type]
    for wrong in [{"chains": -1}, {"seed": -1}, {"steps": 1.5}, {"nonsense": 1}]:
        with pytest.raises((TypeError, OverflowError)):
            model.sample(**wrong)  # type: ignore[arg-type]
