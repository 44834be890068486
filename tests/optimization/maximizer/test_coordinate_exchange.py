"""Hills are found by changes of single variables, where candidates at random are near none of the best."""

import numpy as np
import pytest

from surehold.optimization.maximizer.coordinate_exchange import exchanged
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.surrogates.protocol import Regions

D = 6
SPEEDS, PHASES = np.linspace(14.0, 20.0, D), np.linspace(0.0, 5.0, D)


class Sum:
    """Three hills along each variable, so 729: sum_k cos(s_k x_k + p_k) + x_k / 2."""

    def __call__(self, U):
        return np.sum(np.cos(SPEEDS * U + PHASES) + 0.5 * U, axis=1)

    def with_gradient(self, U):
        return self(U), -SPEEDS * np.sin(SPEEDS * U + PHASES) + 0.5


def best():
    """Return the highest value, to 1e-6: variable by variable on a net."""
    net = np.linspace(0.0, 1.0, 20_001)[:, None]
    return np.sum(np.max(np.cos(SPEEDS * net + PHASES) + 0.5 * net, axis=0))


@pytest.mark.parametrize("seed", range(3))
def test_the_highest_of_many_hills_is_found(seed):
    f = Sum()
    anchors, whole = np.full((1, D), 0.5), Regions.whole(D, separable=True)
    found = multistart(f, f, D, anchors, np.random.default_rng(seed), whole)
    assert f(found[:1])[0] == pytest.approx(best(), abs=1e-6)
    without = multistart(f, f, D, anchors, np.random.default_rng(seed))
    assert f(without[:1])[0] < best() - 0.1


def test_a_sum_takes_one_round_of_all_variables_together():
    f, calls = Sum(), []

    def screen(U):
        calls.append(len(U))
        return f(U)

    start = np.full(D, 0.5)
    found = exchanged(screen, start, np.zeros(D), np.ones(D), np.random.default_rng(0))
    assert calls == [1, 32 * D, 2, 32 * D, 2]
    assert f(found[None, :])[0] > best() - D * (1.0 - np.cos(20.0 / 62.0))  # a place is 1/62 away at most


def test_changes_stay_in_the_box_and_are_better():
    f = Sum()
    lower, upper = np.full(D, 0.2), np.full(D, 0.4)
    start = np.full(D, 0.3)
    found = exchanged(f, start, lower, upper, np.random.default_rng(0))
    assert np.all((lower <= found) & (found <= upper))
    assert f(found[None, :])[0] > f(start[None, :])[0]


def test_nothing_is_returned_where_nothing_is_better():
    start = np.full(D, 0.5)
    assert exchanged(lambda U: -np.sum((U - 0.5) ** 2, axis=1), start, np.zeros(D), np.ones(D), None) is None
    assert exchanged(lambda U: np.full(len(U), -np.inf), start, np.zeros(D), np.ones(D), None) is None
    assert exchanged(lambda U: np.full(len(U), np.nan), start, np.zeros(D), np.ones(D), None) is None


def test_of_many_variables_some_are_looked_at():
    looked = []

    def screen(U):
        looked.append(len(U))
        return -np.sum((U - 0.3) ** 2, axis=1)

    found = exchanged(screen, np.full(50, 0.9), np.zeros(50), np.ones(50), np.random.default_rng(0))
    assert max(looked) <= 512
    assert np.mean(np.abs(found - 0.3) < 0.05) > 0.5
