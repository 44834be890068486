import numpy as np
import pytest

import surehold as sh
from surehold.optimization.strategy.trust_region import box_around, side_after


def test_grows_after_three_successes_in_a_row_and_shrinks_after_as_many_failures_as_variables():
    assert side_after(np.array([1.0, 2.0, 3.0]), 3, 2) == 0.8, "the design says nothing"
    assert side_after(np.arange(1.0, 7.0), 3, 2) == 1.6
    assert side_after(np.array([5.0, *[1.0] * 4]), 1, 2) == 0.4
    assert side_after(np.array([5.0, *[1.0] * 6]), 1, 7) == 0.8
    assert side_after(np.array([5.0, *[1.0] * 7]), 1, 7) == 0.4
    assert side_after(np.array([5.0, 1.0, 1.0, 1.0, 6.0, 1.0, 1.0, 1.0]), 1, 2) == 0.8, (
        "a success starts the count anew"
    )


def test_it_grows_to_its_largest_side_by_trials_that_are_better_than_all_before():
    assert side_after(np.arange(1.0, 40.0), 1, 2) == 1.6
    assert side_after(np.array([10.0, 1.0, 2.0, 3.0, 4.0]), 1, 2) == 0.4


def test_an_improvement_of_rounding_is_none_and_a_collapsed_box_starts_again():
    assert side_after(np.array([5.0, *(5.0 + 1e-6 * np.arange(1, 5))]), 1, 2) == 0.4
    sides = [side_after(np.array([5.0, *[1.0] * (4 * k)]), 1, 2) for k in range(9)]
    np.testing.assert_allclose(sides, [0.8 * 0.5**k for k in range(7)] + [0.8, 0.4])


def test_the_box_stays_inside_the_cube():
    box = box_around(np.array([0.1, 0.5]), 0.4)
    np.testing.assert_allclose(box.lower, [[0.0, 0.3]])
    np.testing.assert_allclose(box.upper, [[0.3, 0.7]])


@pytest.mark.parametrize("surrogate", ["gp", "tgp"])
def test_trials_stay_in_the_box_around_the_best_one(surrogate):
    optimizer = sh.Optimizer(sh.Box.unit(6), n_initial=20, seed=0, surrogate=surrogate, trust_region=True)
    best = None
    for i in range(32):
        u = optimizer.ask()
        if i >= 20:
            side = side_after(optimizer.y, 20, 6)
            best = optimizer.X[int(np.argmax(optimizer.y))]
            assert np.all(np.abs(u - best) <= 0.5 * side + 1e-9), f"trial {i} is outside its box of side {side}"
        optimizer.tell(u, -float(np.square(u - 0.4).sum()))
    assert optimizer.y.max() > -0.05
