"""Operations on traces, by address."""

import copy

import numpy as np
import pytest

import pcadlang

TEXT = """assume spare ~ flip(0.2);
    assume x = if spare { a ~ normal(0, 1); a } else { 3 };
    assume w ~ mv_normal([0, 0], [[1, 0.5], [0.5, 1]]);
    assume s ~ gamma(2, 1);
    observe normal(x + w[0], s) = 2.5 as y;"""


@pytest.fixture
def trace() -> pcadlang.Trace:
    """A trace with a choice of each kind."""
    choices = {"@spare": True, "@x/a": 1.5, "w": [0.5, -0.5], "s": 0.8}
    return pcadlang.Program.parse(TEXT).compile().generate(choices, seed=1)[0]


def test_a_trace_has_its_choices_and_scores(trace: pcadlang.Trace) -> None:
    assert set(trace.choices()) == {"@spare", "@x/a", "@w", "@s"} and len(trace) == 4
    assert trace["x/a"] == 1.5 and trace["@spare"] is True and trace["y"] == 2.5
    assert "x/a" in trace and "x/b" not in trace and "y" in trace
    np.testing.assert_array_equal(trace["w"], [0.5, -0.5])
    assert sum(trace.scores().values()) == pytest.approx(trace.log_prior, abs=1e-12)
    assert trace.score() == pytest.approx(trace.log_prior, abs=1e-12)
    assert trace.log_joint == pytest.approx(trace.log_prior + trace.log_likelihood, abs=1e-12)
    assert trace.observations() == {"@y": 2.5} and trace.value("x") == 1.5
    with pytest.raises(KeyError, match="did you mean `@spare`"):
        trace["spar"]


def test_updates_can_be_undone_bit_for_bit(trace: pcadlang.Trace) -> None:
    before = trace.log_joint
    update = trace.update({"spare": False, "y": 2.0})
    assert "@x/a" not in trace and trace["y"] == 2.0
    assert update.discarded["@x/a"] == 1.5
    back = trace.undo(update)
    assert back.log_weight == -update.log_weight and trace.log_joint == before
    trace["s"] = 1.25
    assert trace["s"] == 1.25
    with pytest.raises(pcadlang.Error):
        trace["s"] = "wide"
    assert trace["s"] == 1.25


def test_proposals_are_pending_until_they_are_committed(trace: pcadlang.Trace) -> None:
    before = trace.log_joint
    weight = trace.propose({"x/a": 0.0})
    assert weight.log_joint == pytest.approx(trace.log_joint - before, abs=1e-12)
    trace.rollback()
    assert trace.log_joint == before
    trace.regenerate(["s"])
    trace.commit()
    assert trace["s"] != 0.8
    other = copy.copy(trace)
    other["s"] = 2.0
    assert trace["s"] != 2.0


def test_gradients_are_those_of_finite_differences(trace: pcadlang.Trace) -> None:
    names = ["x/a", "w", "s"]
    at = trace.coordinates(names)
    assert at.shape == (4,)
    slopes = trace.gradient(names)

    def joint(y: np.ndarray) -> float:
        weight = trace.propose_coordinates(names, y)
        log_joint = trace.log_joint + weight.log_jacobian
        trace.rollback()
        return log_joint

    for i in range(4):
        h = np.zeros(4)
        h[i] = 1e-6
        assert slopes[i] == pytest.approx((joint(at + h) - joint(at - h)) / 2e-6, abs=1e-5)
    with pytest.raises(ValueError, match="discrete"):
        trace.coordinates(["spare"])
    with pytest.raises(ValueError):
        trace.propose_coordinates(names, [1.0])


def test_metropolis_hastings_by_hand_finds_the_posterior() -> None:
    model = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;").compile()
    trace, rng, drawn = model.simulate(seed=3), np.random.default_rng(0), []
    for _ in range(20000):
        weight = trace.propose({"x": trace["x"] + rng.normal(0, 0.7)})
        if np.log(rng.uniform()) < weight.log_weight:
            trace.commit()
        else:
            trace.rollback()
        drawn.append(trace["x"])
    assert np.mean(drawn) == pytest.approx(1.6, abs=0.05)
    assert np.std(drawn) == pytest.approx(5**-0.5, abs=0.03)


def test_importance_weights_average_to_the_evidence() -> None:
    model = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(x, 1) = 1;").compile()
    weights = [np.exp(model.generate({}, seed=1, index=i)[1]) for i in range(20000)]
    exact = np.exp(-0.25) / np.sqrt(4 * np.pi)
    assert np.mean(weights) == pytest.approx(exact, rel=0.02)


def test_saved_traces_are_exact(trace: pcadlang.Trace) -> None:
    model = pcadlang.Program.parse(TEXT).compile()
    again = model.load(trace.save())
    assert again.log_joint == trace.log_joint and again.save() == trace.save()
    with pytest.raises(pcadlang.Error):
        model.load("{}")
    other = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(x, 1) = 0;").compile()
    with pytest.raises(pcadlang.Error):
        other.load(trace.save())


def test_why_names_what_a_choice_depends_on_and_affects(trace: pcadlang.Trace) -> None:
    why = trace.why("x/a")
    assert why["origins"] == ["@spare"] and "x" in why["names"]
    assert [t["address"] for t in why["terms"]] == ["@y"] and why["terms"][0]["effect"] == "scored"


def test_the_same_seed_and_index_give_the_same_trace() -> None:
    model = pcadlang.Program.parse(TEXT).compile()
    assert model.simulate(seed=1, index=4).save() == model.simulate(seed=1, index=4).save()
    assert model.simulate(seed=1, index=4).save() != model.simulate(seed=1, index=5).save()


def test_kernels_move_a_trace() -> None:
    text = "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2 as y;"
    trace = pcadlang.Program.parse(text).compile().simulate(seed=1)
    trace.update({"y": -2.0})
    drawn = []
    for _ in range(400):
        [kernel] = trace.apply("slice(@x);", times=5)
        assert kernel["name"].startswith("slice") and kernel["proposals"] == 5
        drawn.append(trace["x"])
    assert trace["y"] == -2.0 and np.mean(drawn) == pytest.approx(-1.6, abs=0.12)
    assert len(set(drawn)) > 390
    with pytest.raises(pcadlang.Error, match="did you mean `slice`"):
        trace.apply("slize(@x);")
