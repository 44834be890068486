import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

from surehold.optimization.maximizer.ascent import climb


class Rosenbrock:
    """Minus SciPy's Rosenbrock function on [-1, 2]^d, seen from the unit cube; counts the points it is asked for."""

    def __init__(self):
        self.asked = 0

    def __call__(self, U):
        return np.array([-rosen(3.0 * u - 1.0) for u in U])

    def with_gradient(self, U):
        self.asked += len(U)
        return self(U), np.array([-3.0 * rosen_der(3.0 * u - 1.0) for u in U])


def whole(starts):
    return np.zeros_like(starts), np.ones_like(starts)


@pytest.mark.parametrize("d", [2, 5])
def test_finds_the_top_of_a_bent_ridge(d):
    starts = np.random.default_rng(0).random((6, d))
    points, values = climb(Rosenbrock(), starts, *whole(starts), evaluations=400)
    np.testing.assert_allclose(values, Rosenbrock()(points))
    oracle = [
        minimize(lambda u: -Rosenbrock()(u[None])[0], start, bounds=[(0, 1)] * d, method="L-BFGS-B") for start in starts
    ]
    for value, best in zip(values, oracle, strict=True):
        assert value >= -best.fun - 1e-4, f"{value} is below L-BFGS-B's {-best.fun}"


@pytest.mark.parametrize(("scale", "offset"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e5)])
def test_where_it_ends_does_not_depend_on_the_unit_of_the_values(scale, offset):
    """Against a difference of 1 all values of an amplitude of 1e-9 are equal, and those around 1e5 nearly so."""

    class Scaled(Rosenbrock):
        def __call__(self, U):
            return scale * super().__call__(U) + offset

        def with_gradient(self, U):
            return self(U), scale * Rosenbrock.with_gradient(self, U)[1]

    starts = np.random.default_rng(0).random((6, 2))
    wanted, _ = climb(Rosenbrock(), starts, *whole(starts), evaluations=400, unit=1.0)
    points, _ = climb(Scaled(), starts, *whole(starts), evaluations=400, unit=scale)
    np.testing.assert_allclose(points, wanted, atol=1e-4)


def test_each_ascent_is_as_if_it_were_alone():
    starts = np.random.default_rng(1).random((5, 3))
    points, values = climb(Rosenbrock(), starts, *whole(starts))
    for i in range(5):
        alone, value = climb(Rosenbrock(), starts[i : i + 1], *whole(starts[i : i + 1]))
        np.testing.assert_allclose(alone[0], points[i], rtol=1e-9)
        np.testing.assert_allclose(value[0], values[i], rtol=1e-9)


def test_never_leaves_its_box_nor_ends_lower_than_it_began():
    rng = np.random.default_rng(2)
    starts = rng.random((20, 3))
    lower, upper = np.maximum(starts - 0.1, 0.0), np.minimum(starts + 0.05, 1.0)
    points, values = climb(Rosenbrock(), starts, lower, upper)
    assert np.all((points >= lower) & (points <= upper))
    assert np.all(values >= Rosenbrock()(starts))


def test_stops_at_a_corner_of_the_box_where_the_gradient_points_out():
    class Plane:
        def __call__(self, U):
            return U @ np.array([1.0, -2.0])

        def with_gradient(self, U):
            return self(U), np.tile([1.0, -2.0], (len(U), 1))

    starts = np.full((1, 2), 0.5)
    points, _ = climb(Plane(), starts, *whole(starts))
    np.testing.assert_array_equal(points, [[1.0, 0.0]])


def test_keeps_within_its_evaluations():
    function = Rosenbrock()
    starts = np.random.default_rng(3).random((4, 2))
    climb(function, starts, *whole(starts), evaluations=7)
    assert function.asked <= 28


def test_a_start_without_a_finite_value_stays():
    class Hole:
        def __call__(self, U):
            return np.where(U[:, 0] > 0.5, -np.inf, U[:, 0])

        def with_gradient(self, U):
            return self(U), np.where(U > 0.5, np.nan, 1.0)

    starts = np.array([[0.9], [0.2]])
    points, values = climb(Hole(), starts, *whole(starts))
    assert points[0] == 0.9
    assert values[0] == -np.inf
    assert 0.2 < points[1] <= 0.5
