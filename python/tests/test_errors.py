"""Mistakes in programs, as exceptions with the excerpt."""

from pathlib import Path

import pytest

import pcadlang


def test_an_error_shows_the_place() -> None:
    with pytest.raises(pcadlang.Error) as raised:
        pcadlang.Program.parse("let x = norml(0);").compile()
    text = str(raised.value)
    assert "<program>:1:9" in text and "did you mean `norm`?" in text and "^" in text
    [first] = raised.value.diagnostics
    assert (first["file"], first["line"], first["column"]) == ("<program>", 1, 9)
    assert first["severity"] == "error" and "norml" in first["message"]


def test_all_errors_of_a_program_are_reported() -> None:
    with pytest.raises(pcadlang.Error) as raised:
        pcadlang.Program.parse("let x = norml(0);\nlet y = expp(0);").compile()
    assert [d["line"] for d in raised.value.diagnostics] == [1, 2]


def test_errors_at_run_time_name_the_address() -> None:
    model = pcadlang.Program.parse(
        "assume x ~ normal(0, 1); assume y = [1, 2][floor(abs(x)) + 7]; observe normal(y, 1) = 0;"
    ).compile()
    with pytest.raises(pcadlang.Error, match=r"<program>:1:\d+"):
        model.simulate()


def test_a_start_that_is_impossible_says_why() -> None:
    text = "assume x ~ uniform(0, 1); observe uniform(0, x) = 5;"
    with pytest.raises(pcadlang.Error, match="cannot start any chain"):
        pcadlang.Program.parse(text).compile().sample(steps=10)


def test_files_and_data_that_are_missing_are_named() -> None:
    with pytest.raises(pcadlang.Error, match=r"nowhere\.pcad"):
        pcadlang.Program.open("nowhere.pcad")
    with pytest.raises(pcadlang.Error, match="photo"):
        pcadlang.Program.open("lathe.pcad").compile()
    assert pcadlang.Program.open("lathe.pcad").compile(without_data=True)


def test_a_program_reads_only_what_it_may(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "x.csv").write_text("a\n1\n2\n")
    (tmp_path / "own" / "p.pcad").write_text('data d = csv("../x.csv"); assume a ~ normal(0, 1);')
    path = tmp_path / "own" / "p.pcad"
    with pytest.raises(pcadlang.Error, match=r"x\.csv"):
        pcadlang.Program.open(path).compile()
    assert pcadlang.Program.open(path, allow_read=[tmp_path]).compile()
