"""Jobs of the command, from Python."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import pcadlang
from pcadlang.command import arguments


def test_options_are_those_of_the_command() -> None:
    options = {"time": "5s", "set": {"size": 64}, "observe": ["a=1", "b=2"], "quiet": True}
    expected = "--time 5s --set size=64 --observe a=1 --observe b=2 --quiet"
    assert arguments({**options, "seed": None, "json": False}) == expected.split()
    assert arguments({"allow_read": Path("x")}) == ["--allow-read", "x"]


def test_a_run_leaves_its_folder_and_its_summary(tmp_path: Path) -> None:
    said = pcadlang.run("coin.pcad", out=tmp_path / "coin", seed=1, steps=100)
    assert abs(said["quantities"]["heads"]["mean"] - 15 / 22) < 0.1
    assert (tmp_path / "coin" / "report.html").exists()
    with pytest.raises(pcadlang.CommandError, match=r"nowhere\.pcad"):
        pcadlang.run("nowhere.pcad", out=tmp_path / "none")


def test_a_dataset_is_evaluated(tmp_path: Path, images: Path) -> None:
    case = tmp_path / "data" / "cup"
    case.mkdir(parents=True)
    (case / "image.png").write_bytes((images / "coffee_cup.png").read_bytes())
    out = pcadlang.evaluate(
        "lathe.pcad",
        tmp_path / "data",
        out=tmp_path / "out",
        steps=2,
        warmup=2,
        chains=1,
        set={"tries": 5, "keep": 1},
        quiet=True,
    )
    assert (out / "evaluation.json").exists() and (out / "cup" / "depth.npy").exists()


def test_a_bank_is_drawn_at_once_or_in_parts(tmp_path: Path) -> None:
    program = tmp_path / "ball.pcad"
    program.write_text(
        """include "std/scene.pcad" as scene;
        assume size ~ uniform(0.5, 1.5);
        assume ball = scene.affine(scale = size) * scene.sphere(1);"""
    )
    options = {"features_size": 32, "quiet": True}
    whole = pcadlang.learn(program, out=tmp_path / "whole", n=8, **options)
    first = pcadlang.learn(program, out=tmp_path / "a", n=3, **options)
    rest = pcadlang.learn(program, out=tmp_path / "b", n=5, first=3, **options)
    joined = pcadlang.learn(program, out=tmp_path / "c", join=[first, rest], **options)
    assert joined.read_bytes() == whole.read_bytes()


def test_the_module_is_the_command() -> None:
    line = [sys.executable, "-m", "pcadlang", "doc", "sqrt"]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert "sqrt(x)" in done.stdout
    wrong = subprocess.run([*line[:3], "dock"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2 and "unrecognized subcommand" in wrong.stderr


def test_an_interrupt_keeps_what_was_drawn() -> None:
    model = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(x, 1) = 1;").compile()
    timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    posterior = model.sample(chains=2, steps=10**9, seed=1)
    timer.join()
    assert posterior.interrupted and posterior["x"].shape[1] > 100 and posterior.seconds < 30
    assert not model.sample(chains=1, steps=10).interrupted


def test_an_interrupt_leaves_out_chains_that_had_hardly_begun() -> None:
    model = pcadlang.Program.parse("assume x ~ normal(0, 1); observe normal(x, 1) = 1;").compile()
    plan = "infer { warmup 100 { nuts(@x); } repeat 1000000000 { nuts(@x); } }"
    timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    posterior = model.sample(chains=4, threads=1, plan=plan, seed=1)
    timer.join()
    chains, draws = posterior["x"].shape
    stats = posterior.groups()["sample_stats"]
    assert chains < 4 and draws > 100 and posterior.modes == []
    assert stats["step_size"][1].shape == (chains, draws) and (stats["step_size"][1] > 0).all()
