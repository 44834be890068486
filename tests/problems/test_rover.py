"""The rover's path against FITPACK's smoothing spline, and costs counted by hand."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.interpolate import splev, splprep

from surehold.problems.named import named_function
from surehold.problems.rover import OBSTACLES, rover


def test_the_path_is_fitpacks_smoothing_spline():
    x = np.random.default_rng(0).random((20, 60))
    for row, value in zip(x, rover(x), strict=True):
        spline, _ = splprep((1.2 * row - 0.1).reshape(-1, 2).T, k=3)
        path = np.array(splev(np.linspace(0.0, 1.0, 1000), spline)).T
        rates = [
            20.05 if not 0.0 <= min(p) <= max(p) < 1.0 or (abs(OBSTACLES - p).max(axis=1) <= 0.025).any() else 0.05
            for p in path
        ]
        cost = trapezoid(rates, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]))
        misses = 10.0 * (abs(path[0] - 0.05).sum() + abs(path[-1] - 0.95).sum())
        assert value == pytest.approx(5.0 - cost - misses, abs=1e-9)


def test_a_straight_path_pays_for_the_obstacles_it_crosses():
    straight = np.repeat(np.linspace(0.05, 0.95, 30), 2)
    value = float(rover(((straight + 0.1) / 1.2)[None])[0])
    inside, edge = 0.0, 0.05  # along the diagonal, by one coordinate
    for low, high in sorted(zip(OBSTACLES.max(axis=1) - 0.025, OBSTACLES.min(axis=1) + 0.025, strict=True)):
        inside += max(0.0, min(high, 0.95) - max(low, edge))
        edge = max(edge, high)
    assert inside > 0.1
    assert value == pytest.approx(5.0 - 2.0**0.5 * (0.05 * 0.9 + 20.0 * inside), abs=0.1)
    border = np.column_stack([np.linspace(0.0, 1.0, 30), np.full(30, -0.05)]).ravel()
    outside = float(rover(((border + 0.1) / 1.2)[None])[0])
    assert outside == pytest.approx(5.0 - 20.05 - 10.0 * (0.05 + 0.1 + 0.05 + 1.0), abs=1e-9)


def test_one_place_for_all_points_is_a_path_without_length():
    at_start = np.full((1, 60), 0.15 / 1.2)
    assert rover(at_start)[0] == pytest.approx(5.0 - 10.0 * 1.8)


def test_it_is_a_problem_by_name():
    problem = named_function("rover-60")
    values = problem(np.random.default_rng(1).random((50, 60)))
    assert values.shape == (50,)
    assert np.all(values < 0.0)
