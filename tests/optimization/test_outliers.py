import numpy as np
import pytest

import surehold as sh
from surehold.optimization.box import Box
from surehold.optimization.trials import Trials

SQUARE = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})


def told(values):
    trials = Trials(SQUARE)
    points = np.random.default_rng(0).random((len(values), 2))
    trials.restore(points, values, points, ())
    return trials


def test_a_wild_reading_counts_as_the_lowest_other_value():
    trials = told([0.2, 0.7, -30.0, np.nan, 0.1, 0.4])
    assert trials.outliers.tolist() == [False, False, True, False, False, False]
    assert trials.modelled.tolist() == [0.2, 0.7, 0.1, 0.1, 0.1, 0.4]


@pytest.mark.parametrize(
    "values",
    [
        [0.0, 0.0, 0.0, 0.0],
        [1.0],
        [np.nan, np.nan],
        [0.0, 0.0, 0.0, 0.1, -0.05, -0.04],  # grasps: mostly nothing, some collisions
        (-np.geomspace(0.1, 2000.0, 40)).tolist(),  # a valley such as Rosenbrock's
        [0.5, 0.6, -30.0, -31.0, -29.0],  # a third and more: a part of the response
        [1e300, -1e300, 0.0, 1e299],
    ],
)
def test_values_that_belong_to_the_response_stay(values):
    trials = told(values)
    assert not trials.outliers.any()
    if np.isfinite(values).any():
        assert np.array_equal(trials.modelled[np.isfinite(values)], np.array(values)[np.isfinite(values)])


def test_half_of_the_values_equal_to_the_highest_hide_no_outlier_of_the_rest():
    assert told([0.0] * 6 + [0.5, -40.0]).outliers.tolist() == [False] * 7 + [True]


@pytest.mark.parametrize("bad", [-30.0, -1e6])
def test_a_penalty_costs_no_more_than_a_failed_trial(bad):
    def run(value):
        optimizer = sh.Optimizer(SQUARE, seed=3)
        for _ in range(25):
            x = optimizer.ask()
            if x.sum() > 1.4:
                optimizer.tell(x, failed=True) if value is None else optimizer.tell(x, value)
            else:
                optimizer.tell(x, float(np.exp(-((x[0] - 0.63) ** 2 + (x[1] - 0.41) ** 2) / 0.05)))
        return optimizer

    punished, failed = run(bad), run(None)
    assert np.nanmax(punished.y) > 0.999
    assert np.nanmax(failed.y) > 0.999
    assert punished.recommend().outliers == tuple(np.flatnonzero(punished.y == bad))
    assert failed.recommend().outliers == ()
