import doctest
from importlib import import_module
from pkgutil import walk_packages

import pytest

import surehold

MODULES = [
    module.name
    for module in walk_packages(surehold.__path__, "surehold.")
    if not module.name.endswith("__main__") and ".assets" not in module.name
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_of(name):
    result = doctest.testmod(import_module(name))
    assert result.failed == 0, f"{result.failed} of {result.attempted} examples of {name} do not hold"
