import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.strategy.initial_design import DESIGNS, design, drawn_to


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize(("n", "d"), [(1, 1), (5, 1), (7, 3), (40, 2), (64, 7)])
def test_points_of_the_cube_and_reproducible(name, n, d):
    points = design(name, n, d, np.random.default_rng(3))
    assert points.shape == (n, d)
    assert np.all((points >= 0.0) & (points <= 1.0))
    assert np.array_equal(points, design(name, n, d, np.random.default_rng(3)))
    assert not np.array_equal(points, design(name, n, d, np.random.default_rng(4)))


def test_latin_hypercube_has_one_point_a_slice():
    points = design("latin_hypercube", 30, 4, np.random.default_rng(0))
    slices = np.sort(np.floor(points * 30), axis=0)
    assert np.array_equal(slices, np.repeat(np.arange(30.0)[:, None], 4, axis=1))


def test_sobol_covers_better_than_chance():
    from scipy.stats import qmc

    even = qmc.discrepancy(design("sobol", 64, 2, np.random.default_rng(0)))
    chance = np.mean([qmc.discrepancy(np.random.default_rng(i).random((64, 2))) for i in range(20)])
    assert even < 0.2 * chance


def test_unknown_name():
    with pytest.raises(InputError, match="latin_hypercube"):
        design("grid", 3, 2, np.random.default_rng(0))


def test_two_of_three_points_keep_a_guess_and_the_third_is_anywhere():
    points = design("latin_hypercube", 12, 3, np.random.default_rng(0))
    moved = drawn_to(np.array([np.nan, 0.25, 1.0]), points)
    kept = np.arange(12) % 3 != 2
    np.testing.assert_array_equal(moved[kept, 1:], np.broadcast_to([0.25, 1.0], (8, 2)))
    np.testing.assert_array_equal(moved[~kept], points[~kept])
    np.testing.assert_array_equal(moved[:, 0], points[:, 0])


def test_around_a_guess_of_all_coordinates_no_two_points_are_the_same():
    points = design("latin_hypercube", 12, 2, np.random.default_rng(0))
    guess = np.array([0.3, 0.9])
    moved = drawn_to(guess, points)
    np.testing.assert_array_equal(moved[0], guess)
    np.testing.assert_array_equal(moved[2::3], points[2::3])
    assert len(np.unique(moved, axis=0)) == 12
    share = np.linalg.norm(moved - guess, axis=1) / np.linalg.norm(points - guess, axis=1)
    np.testing.assert_allclose(share[np.arange(12) % 3 != 2], np.array([0, 1, 3, 4, 6, 7, 9, 10]) / 24)


def test_of_points_that_would_be_the_same_trial_with_a_guess_one_is_made_there():
    """A guess of all variables that are not fixed, or whose others are few choices, was tried again and again."""
    points = design("latin_hypercube", 12, 2, np.random.default_rng(0))
    moved = drawn_to(np.array([0.3, np.nan]), points, snap=lambda u: np.array([u[0], np.round(u[1])]))
    kept = np.arange(12) % 3 != 2
    tried = np.column_stack([moved[:, 0], np.round(moved[:, 1])])
    assert len(np.unique(tried, axis=0)) == 12
    assert sorted(tried[kept & (moved[:, 0] == 0.3), 1]) == [0.0, 1.0]
    assert np.all(np.abs(moved[kept, 0] - 0.3) <= 0.5 * np.abs(points[kept, 0] - 0.3))
    again = drawn_to(np.array([0.3, 0.9]), points, before=np.array([[0.3, 0.9]]))
    assert not np.any(np.all(again == [0.3, 0.9], axis=1)), "it is to be tried already"


def test_what_is_not_allowed_with_a_guess_takes_other_coordinates():
    points, pool = (design("latin_hypercube", n, 2, np.random.default_rng(n)) for n in (12, 200))

    def allowed(U):
        return U.sum(axis=1) <= 0.6

    moved = drawn_to(np.array([0.4, np.nan]), points, allowed=allowed, pool=pool)
    kept = np.arange(12) % 3 != 2
    assert np.all(moved[kept, 0] == 0.4)
    assert allowed(moved[kept]).all()
    np.testing.assert_array_equal(moved[~kept], points[~kept])
    never = drawn_to(np.array([0.7, np.nan]), points, allowed=allowed, pool=pool)
    assert not np.any(allowed(never) & (never[:, 0] == 0.7))
