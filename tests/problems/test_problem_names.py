import pytest

import surehold.problems as problems


def test_names_resolve_lazily_and_are_listed():
    assert len(problems.__all__) >= 17
    for name in problems.__all__:
        assert getattr(problems, name).__name__ == name
    with pytest.raises(AttributeError, match="Nothing"):
        problems.Nothing  # noqa: B018
