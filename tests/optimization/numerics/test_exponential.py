import numpy as np
from mpmath import mp
from numba import njit

from surehold.optimization.numerics.exponential import exponential


@njit
def _each(x):
    out = np.empty_like(x)
    for i in range(x.size):
        out[i] = exponential(x[i])
    return out


def test_two_units_in_the_last_place_from_the_exact_value():
    x = -np.concatenate([[0.0, 1e-300, 1e-17, 700.0], np.logspace(-8, np.log10(700.0), 400)])
    with mp.workdps(30):
        exact = [mp.exp(mp.mpf(float(value))) for value in x]
        errors = [
            float(abs(mp.mpf(float(found)) - true)) / np.spacing(float(true))
            for found, true in zip(_each(x), exact, strict=True)
        ]
    assert max(errors) <= 2.0
