import pkgutil
import subprocess
import sys
from importlib import import_module

import pytest

import surehold as sh

HEAVY = ("scipy.stats", "matplotlib", "mujoco", "numba", "trimesh", "optuna", "sklearn", "typer")


def test_the_list_is_sorted_and_has_no_doubles():
    assert list(sh.__all__) == sorted(set(sh.__all__))


@pytest.mark.parametrize("name", sh.__all__)
def test_every_name_resolves(name):
    value = getattr(sh, name)
    assert value is not None
    assert getattr(sh, name) is value
    assert value.__doc__, f"{name} has no documentation"


def test_no_name_is_missing():
    assert set(sh._HOMES) | {"grasping", "problems"} <= set(sh.__all__)
    assert set(sh.__all__) | {"__version__"} == set(dir(sh))


def test_names_live_where_they_say():
    for name, home in sh._HOMES.items():
        module = import_module(f"surehold.{home}")
        assert getattr(module, name) is getattr(sh, name)
        assert name in module.__all__


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(AttributeError, match="Optimizer"):
        sh.optimiser  # noqa: B018


def test_import_is_light():
    code = f"import sys, surehold; print([m for m in {HEAVY} if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60).stdout
    assert loaded.strip() == "[]", f"`import surehold` loads {loaded}"


@pytest.mark.parametrize("package", ["surehold", "surehold.grasping", "surehold.problems", "surehold.studies"])
def test_no_name_hides_behind_a_module_of_the_same_name(package):
    """A submodule becomes an attribute of its package once anything imports it, in place of a function of that name."""
    root = import_module(package)
    modules = {module.name for module in pkgutil.iter_modules(root.__path__)}
    assert not modules & (set(root.__all__) - {"grasping", "problems"})
