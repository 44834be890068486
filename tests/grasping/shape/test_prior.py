import numpy as np
import pytest

from surehold.grasping.object.solids import RoundedBox, signed_distance
from surehold.grasping.shape.prior import PriorShape

HALF = np.array([0.03, 0.05, 0.02])
TURN = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]


@pytest.mark.parametrize("kind", ["box", "ellipsoid"])
def test_gradient_and_second_derivatives_are_those_of_the_value(kind):
    shape = PriorShape(kind, np.array([0.01, -0.02, 0.03]), TURN, HALF)
    x = shape.center + np.random.default_rng(0).uniform(-0.09, 0.09, (60, 3))
    h = 1e-6
    gradient = np.stack([(shape.value(x + h * e) - shape.value(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    hessian = np.stack([(shape.gradient(x + h * e) - shape.gradient(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    assert np.abs(gradient - shape.gradient(x)).max() < 1e-7
    assert np.abs(hessian - shape.hessian(x)).max() < 1e-4 * np.abs(hessian).max()


def test_box_is_the_exact_distance_of_a_rounded_box():
    shape = PriorShape("box", np.zeros(3), np.eye(3), HALF)
    x = np.random.default_rng(1).uniform(-0.08, 0.08, (500, 3))
    assert shape.value(HALF[None]) == pytest.approx(0.2 * HALF.min() * (np.sqrt(3.0) - 1.0)), "round by a fifth"
    outside = shape.value(x) > 0.0
    exact = signed_distance((RoundedBox((0, 0, 0), tuple(HALF), shape.rounding),), x)[0]
    assert np.abs(shape.value(x) - exact)[outside].max() < 1e-12


def test_ellipsoid_vanishes_on_its_surface_with_slope_one():
    shape = PriorShape("ellipsoid", np.zeros(3), np.eye(3), HALF)
    u = np.random.default_rng(2).standard_normal((50, 3))
    x = HALF * u / np.linalg.norm(u, axis=1)[:, None]
    assert np.abs(shape.value(x)).max() < 1e-15
    assert np.linalg.norm(shape.gradient(x), axis=1) == pytest.approx(np.ones(50), abs=1e-12)
