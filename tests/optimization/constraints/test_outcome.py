import mpmath
import numpy as np
import pytest
from scipy.optimize import approx_fprime, check_grad
from scipy.stats import norm

from surehold.optimization.box import Box
from surehold.optimization.constraints.outcome import Within, execution_probability, interval, log_interval
from surehold.optimization.limits import Limit
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, gauss_hermite
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

RNG = np.random.default_rng(0)
X = RNG.random((12, 2))


@pytest.fixture(scope="module")
def posterior():
    return GaussianProcess().condition(X, 3.0 * X[:, 0] + np.sin(4.0 * X[:, 1]), np.random.default_rng(1))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (-1.0, 2.0),
        (1.0, 3.0),
        (-40.0, -38.0),
        (38.0, 40.0),
        (-np.inf, -30.0),
        (30.0, np.inf),
        (5.0, 5.0001),
        (-9.0, 9.0),
    ],
)
def test_log_interval_against_mpmath(a, b):
    with mpmath.workdps(60):
        exactly = (
            mpmath.ncdf(mpmath.mpf(b)) - mpmath.ncdf(mpmath.mpf(a)) if a < 0 else mpmath.ncdf(-a) - mpmath.ncdf(-b)
        )
        expected = float(mpmath.log(exactly))
        density_a, density_b = (float(mpmath.npdf(end) / exactly) if np.isfinite(end) else 0.0 for end in (a, b))
    value, by_a, by_b = log_interval(np.array([a]), np.array([b]))
    assert value[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert by_a[0] == pytest.approx(-density_a, rel=1e-6, abs=1e-12)
    assert by_b[0] == pytest.approx(density_b, rel=1e-6, abs=1e-12)


def test_an_interval_that_is_turned_over_is_unlikely_but_finite():
    value, by_a, by_b = log_interval(np.array([2.0]), np.array([1.0]))
    assert np.isfinite([value[0], by_a[0], by_b[0]]).all()
    assert value[0] == pytest.approx(norm.logpdf(1.5) + np.log(1e-6), abs=1e-3)
    slopes = approx_fprime(np.array([2.0, 1.0]), lambda ends: log_interval(*ends[:, None])[0][0], 1e-6)
    np.testing.assert_allclose([by_a[0], by_b[0]], slopes, rtol=1e-3)


def test_interval_keeps_its_digits_in_the_upper_tail():
    assert interval(np.array([9.0]), np.array([10.0]))[0] == pytest.approx(
        norm.sf(9.0) - norm.sf(10.0), rel=1e-12, abs=0.0
    )


@pytest.mark.parametrize("limit", [Limit("c", -np.inf, 1.5), Limit("c", 1.0, np.inf), Limit("c", 0.8, 2.0)])
def test_probability_without_noise_is_that_of_the_mixture_of_normals(posterior, limit):
    U = RNG.random((20, 2))
    moments = posterior.moments(U)
    std = np.sqrt(moments.variance)
    expected = (norm.cdf(limit.upper, moments.mean, std) - norm.cdf(limit.lower, moments.mean, std)).mean(axis=0)
    within = Within(posterior, limit, Perturbations(exact(2)), 1.645)
    assert np.exp(within.log_probability(U)[0]) == pytest.approx(expected, abs=1e-10)
    assert execution_probability([(posterior, limit)], Perturbations(exact(2)), U) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize(("deviation", "border"), [(0.0, "extend"), (0.05, "extend"), (0.2, "clip")])
@pytest.mark.parametrize("limit", [Limit("c", -np.inf, 1.5), Limit("c", 0.8, 2.2)])
def test_gradients_by_differences(posterior, limit, deviation, border):
    noise = InputNoise.unit(deviation) if deviation else None
    perturbations = Perturbations.of(noise, Box.unit(2), "unscented", border)
    within = Within(posterior, limit, perturbations, 1.645)
    for u in RNG.random((6, 2)):
        error = check_grad(
            lambda v: within.log_probability(v[None])[0][0],
            lambda v: within.log_probability(v[None], True)[1][0],
            u,
            epsilon=1e-6,
        )
        scale = 1.0 + np.abs(within.log_probability(u[None], True)[1]).max()
        assert error < 1e-4 * scale


def test_gradients_under_noise_that_varies(posterior):
    noise = InputNoise.varying(lambda x: np.array([0.02 + 0.2 * x[0], 0.05 + 0.1 * x[1]]))
    perturbations = Perturbations.of(noise, Box.unit(2), "quasi_monte_carlo")
    requirement = Within(posterior, Limit("c", 0.8, 2.2), perturbations, norm.ppf(0.9))
    for u in np.random.default_rng(3).random((4, 2)):
        slope = approx_fprime(u, lambda v: requirement.log_probability(v[None])[0][0], 1e-6)
        np.testing.assert_allclose(requirement.log_probability(u[None], gradient=True)[1][0], slope, rtol=1e-3)


def test_under_noise_the_share_of_executions_of_a_linear_output():
    # c = 3 a is learnt exactly; of executions at a the share Phi((limit / 3 - a) / sd) keeps the limit.
    points = np.random.default_rng(2).random((25, 1))
    posterior = GaussianProcess(kernel="squared_exponential").condition(
        points, 3.0 * points[:, 0], np.random.default_rng(0)
    )
    box, sd = Box.unit(1), 0.05
    limit = Limit("c", -np.inf, 1.5)
    accurate = Perturbations.of(InputNoise.unit(sd), box, "quasi_monte_carlo", exponent=9)
    U = np.linspace(0.3, 0.6, 7)[:, None]
    share = execution_probability([(posterior, limit)], accurate, U)
    assert share == pytest.approx(norm.cdf((0.5 - U[:, 0]) / sd), abs=0.005)
    # and the requirement that 95 % do turns from sure to impossible where 1.645 sd are left
    within = Within(posterior, limit, Perturbations.of(InputNoise.unit(sd), box, "unscented"), norm.ppf(0.95))
    edge = 0.5 - norm.ppf(0.95) * sd
    inside, outside = np.exp(within.log_probability(np.array([[edge - 0.005], [edge + 0.005]]))[0])
    assert inside > 0.99
    assert outside < 0.01


def test_executions_count_by_the_weights_of_their_perturbations(posterior):
    limit, perturbations = Limit("c", 0.8, 2.0), Perturbations(gauss_hermite(np.diag([0.02, 0.05])))
    U = np.random.default_rng(4).random((5, 2))
    each = [
        execution_probability([(posterior, limit)], Perturbations(exact(2)), around)
        for around in perturbations.around(U)
    ]
    expected = np.array(each) @ perturbations.quadrature.weights
    np.testing.assert_allclose(execution_probability([(posterior, limit)], perturbations, U), expected)


def test_two_outputs_share_the_place_of_an_execution(posterior):
    # The same output twice with complementary limits: no execution keeps both, whatever the noise.
    U = RNG.random((5, 2))
    accurate = Perturbations.of(InputNoise.unit(0.2), Box.unit(2), "quasi_monte_carlo")
    both = [(posterior, Limit("c", -np.inf, 1.5)), (posterior, Limit("c", 1.5, np.inf))]
    apart = [execution_probability([one], accurate, U) for one in both]
    together = execution_probability(both, accurate, U)
    assert apart[0] + apart[1] == pytest.approx(1.0, abs=1e-9)
    assert np.all(together < 0.5 * apart[0] * apart[1] + 0.02)
