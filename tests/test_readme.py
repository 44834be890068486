"""The examples of the README run and give what it says."""

import doctest
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_readme_examples_run():
    results = doctest.testfile(str(README), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert results.attempted >= 8, "the README has lost its examples"
    assert results.failed == 0, f"{results.failed} of {results.attempted} README examples differ from what they print"
