import numpy as np
from scipy.optimize import rosen, rosen_der

from surehold.optimization.numerics.differences import by_differences


def test_gradients_of_rosenbrocks_function_in_one_call():
    asked = []

    def f(U):
        asked.append(len(U))
        return np.array([rosen(u) for u in U])

    U = np.random.default_rng(0).random((4, 3))
    values, gradients = by_differences(f, U)
    np.testing.assert_array_equal(values, [rosen(u) for u in U])
    np.testing.assert_allclose(gradients, [rosen_der(u) for u in U], rtol=1e-5, atol=1e-4)
    assert asked == [4 * (1 + 2 * 3)]
