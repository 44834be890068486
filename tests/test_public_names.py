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


def test_names_are_public_where_they_live():
    for name in set(sh.__all__) - {"grasping", "problems"}:
        home = import_module(getattr(sh, name).__module__)
        assert home.__name__.startswith("surehold.")
        assert name in home.__all__


def test_an_unknown_name_suggests_a_known_one():
    code = "import surehold; surehold.Optimiser"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 1
    assert "Did you mean: 'Optimizer'?" in done.stderr


def test_import_is_light():
    code = f"import sys, surehold; print([m for m in {HEAVY} if m in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600
    ).stdout
    assert loaded.strip() == "[]", f"`import surehold` loads {loaded}"


@pytest.mark.parametrize("package", ["surehold", "surehold.grasping", "surehold.problems", "surehold.studies"])
def test_no_name_hides_behind_a_module_of_the_same_name(package):
    """A submodule becomes an attribute of its package once anything imports it, in place of a function of that name."""
    root = import_module(package)
    modules = {module.name for module in pkgutil.iter_modules(root.__path__)}
    assert not modules & (set(root.__all__) - {"grasping", "problems"})


def test_what_people_print_is_short():
    box = sh.Box({"x": (0.0, 1.0)})
    for shown in (sh.GaussianProcess(), sh.TreedGaussianProcess(), sh.Optimizer(box), box, sh.InputNoise.unit(0.03)):
        assert repr(shown).lstrip("<").startswith(type(shown).__name__)
        assert " at 0x" not in repr(shown)
        assert len(repr(shown)) < 130
