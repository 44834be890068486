import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.quadratures import gauss_hermite
from surehold.optimization.surrogates.gaussian_process.closed_form import closed_form

RNG = np.random.default_rng(0)
X = RNG.random((25, 2))
Y = np.sin(7.0 * X[:, 0]) + X[:, 1] ** 2
Q = RNG.random((6, 2))
S = np.array([[0.004, 0.002], [0.002, 0.003]])


@pytest.fixture(scope="module", params=[0.0, 0.5])
def posterior(request):
    return sh.GaussianProcess(kernel="squared_exponential", mean_variance=request.param).fit(X, Y).posterior


def test_equals_a_fine_quadrature(posterior):
    found = closed_form(posterior, Q, S)
    fine = posterior.average(Q, *gauss_hermite(S, 20))
    np.testing.assert_allclose(found.mean, fine.mean, atol=1e-6)
    np.testing.assert_allclose(found.variance, fine.variance, atol=1e-6)


def test_gradients(posterior):
    found = closed_form(posterior, Q, S, gradient=True)
    h = 1e-5
    for k in range(2):
        step = h * np.eye(2)[k]
        up, down = closed_form(posterior, Q + step, S), closed_form(posterior, Q - step, S)
        np.testing.assert_allclose(found.mean_gradient[..., k], (up.mean - down.mean) / (2 * h), rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(
            found.variance_gradient[..., k], (up.variance - down.variance) / (2 * h), rtol=1e-3, atol=1e-5
        )


def test_no_noise_is_the_prediction(posterior):
    found, plain = closed_form(posterior, Q, np.zeros((2, 2))), posterior.moments(Q)
    np.testing.assert_allclose(found.mean, plain.mean, atol=1e-9)
    np.testing.assert_allclose(found.variance, plain.variance, atol=1e-9)


def test_in_the_optimizer():
    def f(x):
        return float(1.5 * np.exp(-0.5 * ((x[0] - 0.2) / 0.02) ** 2) + np.exp(-0.5 * ((x[0] - 0.7) / 0.1) ** 2))

    smooth = sh.GaussianProcess(kernel="squared_exponential")
    settings = {"input_noise": sh.InputNoise.unit(0.05), "surrogate": smooth, "quadrature": "closed_form", "seed": 0}
    result = sh.maximize(f, sh.Box({"x": (0.0, 1.0)}), 35, **settings)
    assert result.recommendation.x[0] == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(
    "settings",
    [
        {"surrogate": "gp"},
        {"surrogate": "tgp"},
        {"border": "clip"},
        {"input_noise": sh.InputNoise.uniform({"x1": 0.1, "x2": 0.1})},
    ],
)
def test_refused_where_it_does_not_hold(settings):
    own = {"input_noise": sh.InputNoise.unit(0.1), **settings}
    with pytest.raises(InputError, match="closed_form"):
        sh.maximize(lambda x: float(x.sum()), sh.Box.unit(2), 14, quadrature="closed_form", **own)
