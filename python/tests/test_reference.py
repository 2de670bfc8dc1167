"""The page of reference is that of the docstrings."""

import importlib.util
from pathlib import Path

import pcadlang

SCRIPT = Path(__file__).parents[1] / "reference.py"


def test_the_page_is_made_from_the_docstrings() -> None:
    spec = importlib.util.spec_from_file_location("reference", SCRIPT)
    assert spec is not None and spec.loader is not None
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    written = reference.PAGE.read_text(encoding="utf-8")
    assert written == reference.page(), "python/reference.py --write"


def test_everything_public_has_a_docstring() -> None:
    for name in pcadlang.__all__:
        of = getattr(pcadlang, name)
        assert isinstance(of, str) or of.__doc__, name
        if isinstance(of, type):
            for key, member in vars(of).items():
                assert key.startswith("_") or member.__doc__, f"{name}.{key}"
