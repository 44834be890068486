import math
import re
from pathlib import Path

import pytest

from surehold.grasping.object.shipped import shipped_object
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems import GraspProblem
from surehold.problems.grasp.measured import MEASURED, measured_thresholds, threshold_in_words

NOISE = InputNoise.unit(0.03)  # under which the thresholds were measured
PAGE = Path(__file__).parents[3] / "docs" / "results" / "quality-predicts.md"


@pytest.mark.parametrize(("obj", "facet"), MEASURED)
def test_the_thresholds_are_those_of_the_documentation(obj, facet):
    found = measured_thresholds(GraspProblem(obj, facet), NOISE)
    row = re.findall(rf"^\| {obj}, 8 N \|.*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)[-1]
    grasps, none_below, most_above = (cell.strip() for cell in row.split("|")[2:-1])
    assert found.grasps == int(grasps)
    for value, cell in ((found.none_below, none_below), (found.most_above, most_above)):
        assert math.isnan(value) if cell == "–" else value == float(cell)


def test_what_they_say_of_a_grasp():
    problem = GraspProblem("bottle")
    low, high = MEASURED["bottle", "right-front"][1:]
    assert f"none below {low:g} was held" in threshold_in_words(problem, 0.9 * low, NOISE)
    assert "nine of ten" not in threshold_in_words(problem, 0.9 * low, NOISE)
    between = threshold_in_words(problem, 0.5 * (low + high), NOISE)
    assert f"none below {low:g} was held, nine of ten above {high:g}" in between
    assert f"nine of ten above {high:g} were held" in threshold_in_words(problem, 1.1 * high, NOISE)
    assert threshold_in_words(problem, math.nan, NOISE) == ""
    assert "none was held with 8 N a finger" in threshold_in_words(GraspProblem("drill"), 0.1, NOISE)


@pytest.mark.parametrize(
    "other",
    [
        {"facet": "front-right"},
        {"hand": "icub-right"},
        {"preshape": "pinch"},
        {"quality": "volume"},
        {"contact": "single"},
        {"closing": "synergy"},
        {"friction": 1.0},
        {"torsion": 0.001},
        {"cones": "polyhedral"},
        {"variables": ("dx", "dy", "rz")},
    ],
)
def test_of_other_grasps_nothing_is_said(other):
    assert threshold_in_words(GraspProblem("bottle", **other), 0.2, NOISE) == ""


def test_under_another_noise_nothing_is_said():
    problem = GraspProblem("bottle", variables=("dx", "dy", "dz"))
    sizes = problem.box.upper - problem.box.lower
    same = InputNoise(dict(zip(problem.box.names, 0.03 * sizes, strict=True)))
    assert measured_thresholds(problem, same) == MEASURED["bottle", "right-front"]
    for other in (InputNoise.unit(0.1), InputNoise({"dx": 0.003, "dy": 0.003, "dz": 0.0}), None):
        assert threshold_in_words(problem, 0.2, other) == ""


def test_of_another_object_of_that_name_nothing_is_said():
    from dataclasses import replace

    other = replace(shipped_object("bottle"), mass=1.0)
    assert measured_thresholds(GraspProblem(other), NOISE) is None
