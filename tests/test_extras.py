"""The core works alone, and each part says in one line what it needs."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from surehold.extras import EXTRAS, MODULES

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
BEYOND_THE_CORE = sorted({MODULES.get(name, name) for names in EXTRAS.values() for name in names})

#: every module beyond the core is as if it were not installed
BLOCKED = f"import sys\nfor name in {BEYOND_THE_CORE}: sys.modules[name] = None\n"

CORE = """
import surehold as sh

box = sh.Box({"a": (0.0, 1.0), "b": (-1.0, 1.0)})
noise = sh.InputNoise.unit(0.05)
for surrogate in ("gp", "tgp"):
    optimizer = sh.Optimizer(box, input_noise=noise, surrogate=surrogate, n_initial=4, seed=0)
    for _ in range(6):
        x = optimizer.ask()
        optimizer.tell(x, -float((x**2).sum()))
    assert box.contains(optimizer.recommend().x)
assert sh.maximize(lambda x: -abs(float(x[0])), box, 6, n_initial=5).recommendation.n == 6
assert sh.problems.RKHS()([0.5]) is not None
print("works")
"""

DOORS = {
    "grasp": "surehold.problems.GraspProblem",
    "study": "surehold.Sampler",
    "report": "import surehold.reports",
    "campaign": "import surehold.campaigns",
    "sklearn": "import surehold.sklearn",
    "gest": "import surehold.gest",
}


def python(code, folder=None):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=600, cwd=folder
    )


def test_the_core_works_alone():
    done = python(BLOCKED + CORE)
    assert done.stdout == "works\n", done.stderr


@pytest.mark.parametrize("extra", DOORS)
def test_a_part_whose_extra_is_missing_names_the_command(extra):
    done = python(f"{BLOCKED}import surehold\n{DOORS[extra]}")
    last = done.stderr.splitlines()[-1]
    assert last.startswith("surehold.extras.MissingExtra: surehold.")
    assert last.endswith(f"run: pip install 'surehold[{extra}]'.")


def test_reports_of_runs_and_campaigns_do_without_studies():
    """As `make grasp` installs them; a report of a study is one of studies."""
    needed = {name for extra in ("campaign", "cli", "grasp", "report") for name in EXTRAS[extra]}
    missing = sorted({MODULES.get(name, name) for name in set(EXTRAS["study"]) - needed})
    assert "optuna" in missing
    code = """
import importlib, pkgutil
for floor in ("surehold.reports", "surehold.campaigns"):
    for module in pkgutil.walk_packages(importlib.import_module(floor).__path__, f"{floor}."):
        if module.name != "surehold.reports.study_report":
            importlib.import_module(module.name)
print("works")
"""
    done = python(f"import sys\nfor name in {missing}: sys.modules[name] = None\n{code}")
    assert done.stdout == "works\n", done.stderr


@pytest.mark.parametrize(
    ("arguments", "blocked", "extra"),
    [
        ("", ["typer"], "cli"),
        ("grasp mug", ["trimesh"], "grasp"),
        ("maximize rkhs", ["matplotlib"], "report"),
        ("study status nothing", ["optuna"], "study"),
        ("explore bottle --trials 1", ["igl"], "mesh"),
    ],
)
def test_the_command_line_says_it_in_one_line(arguments, blocked, extra):
    code = f"import sys\nfor name in {blocked}: sys.modules[name] = None\n"
    done = python(f"{code}from surehold.cli import main\nmain({arguments.split()})")
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith(f"pip install 'surehold[{extra}]'.\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--help", "grasp"),
        ("--version", "surehold"),
        ("grasp --help", "--preshape"),
        ("campaign list", "robust"),
        ("study create rig --parameters x=0:1", "Created study rig"),
    ],
)
def test_commands_that_grasp_nothing_do_without_what_grasps_need(arguments, said, tmp_path):
    code = "import sys\nfor name in ('trimesh', 'manifold3d'): sys.modules[name] = None\n"
    done = python(f"{code}from surehold.cli import main\nmain({arguments.split()})", tmp_path)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


def test_the_packages_of_an_extra_are_those_of_the_project_file():
    """What an extra takes from another one is asked for at that one's door."""
    for extra, names in EXTRAS.items():
        listed = {re.match(r"[\w-]+", line)[0] for line in PROJECT["optional-dependencies"][extra]}
        assert set(names) == listed - {"surehold"}, extra


def test_all_is_all():
    extras = set(PROJECT["optional-dependencies"]) - {"all", "dev", "docs", "peers"}
    assert extras == set(EXTRAS)
    assert PROJECT["optional-dependencies"]["all"] == [f"surehold[{','.join(sorted(extras))}]"]
