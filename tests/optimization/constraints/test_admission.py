"""What is required of a trial beside an acquisition function: values and slopes against what is written down here."""

import numpy as np
import pytest

from surehold.optimization.constraints.admission import Admission

U = np.array([[0.2, 0.9], [0.7, 0.8], [0.95, 0.6], [0.9, 0.97], [0.4, 0.3]])


class Objective:
    """x + y - 1.3, of either sign."""

    def __init__(self, nature):
        self.nature = nature

    def __call__(self, V):
        return V.sum(axis=1) - 1.3

    def with_gradient(self, V):
        return self(V), np.ones(V.shape)


class Coordinate:
    """A probability that is one coordinate."""

    def __init__(self, k):
        self._k = k

    def log_probability(self, V, gradient=False):
        slope = np.zeros(V.shape)
        slope[:, self._k] = 1.0 / V[:, self._k]
        return np.log(V[:, self._k]), slope if gradient else slope[:0]


def expected(nature, value, P):
    if nature == "logarithm":
        return value + np.log(P)
    if nature == "bound":  # it has no zero to be multiplied from
        return np.where(P >= 0.5, value, -1e100 * (1.0 - P))
    return np.where(value > 0.0, value * P, value * (2.0 - P))  # what is unlikely is worse, also below zero


@pytest.mark.parametrize("nature", ["improvement", "logarithm", "bound"])
def test_what_is_required_weighs_the_objective(nature):
    objective, requirements = Objective(nature), (Coordinate(0), Coordinate(1))
    weighed = Admission(requirements=requirements).weighed(objective)
    exactly = expected(nature, objective(U), U.prod(axis=1))
    np.testing.assert_allclose(weighed(U), exactly, rtol=1e-12)
    values, gradients = weighed.with_gradient(U)
    np.testing.assert_allclose(values, exactly, rtol=1e-12)
    steps = 1e-6 * np.eye(2)
    numeric = [(weighed(u + steps) - weighed(u - steps)) / 2e-6 for u in U]
    np.testing.assert_allclose(gradients, numeric, rtol=1e-6, atol=1e-9)


def test_what_is_not_safe_cannot_be_tried():
    admission = Admission(requirements=(Coordinate(0),), safe=lambda V: V[:, 1] > 0.7)
    safe = U[:, 1] > 0.7
    assert np.array_equal(admission.possible(U), safe)
    for values in (admission.weighed(Objective("bound"))(U), admission.weighed(Objective("bound")).with_gradient(U)[0]):
        assert np.array_equal(np.isneginf(values), ~safe)
    assert np.array_equal(admission.among(U, np.random.default_rng(0)), U[safe])
