import importlib.util

import pytest

import surehold.problems as problems


def test_names_resolve_lazily_and_are_listed():
    assert sorted(problems._HOMES) == sorted(problems.__all__)
    for name in problems.__all__:
        if importlib.util.find_spec(f"surehold.problems.{problems._HOMES[name]}") is not None:
            assert getattr(problems, name).__name__ == name
    with pytest.raises(AttributeError, match="Nothing"):
        problems.Nothing  # noqa: B018
