import numpy as np
import pytest
from scipy.stats import norm

from surehold.errors import InputError
from surehold.optimization.acquisition.criteria import expected_improvement
from surehold.optimization.acquisition.scales import CRITERIA, Acquisition, CriterionName, criterion_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import BORDERS, Perturbations
from surehold.optimization.noise.quadratures import Quadrature, exact, sigma_points
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

S = np.diag([0.01, 0.0025])
U = np.array([[0.31, 0.52], [0.8, 0.15], [0.04, 0.97]])


@pytest.fixture(scope="module")
def posterior():
    X = np.random.default_rng(0).random((12, 2))
    return GaussianProcess().fit(X, np.sin(4 * X[:, 0]) * np.cos(3 * X[:, 1])).posterior


def acquisition_of(posterior, name, border="extend", best=0.3, k=1.0):
    named = criterion_name(name)
    points = exact(2) if named.scale == "exact" else sigma_points(S, k)
    return Acquisition(posterior, named, Perturbations(points, border), best)


@pytest.mark.parametrize("name", [name for name in CRITERIA if "thompson" not in name])
@pytest.mark.parametrize("border", BORDERS)
def test_gradients(name, border, posterior):
    acquisition = acquisition_of(posterior, name, border)
    values = acquisition(U)
    h = 1e-6
    together, gradients = acquisition.with_gradient(U)
    np.testing.assert_allclose(together, values, rtol=1e-9, atol=1e-12)
    for i, u in enumerate(U):
        steps = h * np.eye(2)
        numeric = (acquisition(u + steps) - acquisition(u - steps)) / (2 * h)
        np.testing.assert_allclose(gradients[i], numeric, rtol=1e-4, atol=1e-6)


def test_improvement_is_averaged_over_particles(posterior):
    moments = posterior.moments(U)
    by_hand = np.mean(
        [expected_improvement(m, np.sqrt(v), 0.3).value for m, v in zip(moments.mean, moments.variance, strict=True)],
        axis=0,
    )
    np.testing.assert_allclose(acquisition_of(posterior, "ei")(U), by_hand, atol=1e-12)
    np.testing.assert_allclose(np.exp(acquisition_of(posterior, "log_ei")(U)), by_hand, atol=1e-12)


def test_unscented_improvement_by_hand(posterior):
    """Thesis (3.20): the weighted sum of the improvement at the sigma points."""
    ei = acquisition_of(posterior, "ei")
    offsets, weights = sigma_points(S)
    by_hand = sum(w * ei(U + xi) for w, xi in zip(weights, offsets, strict=True))
    np.testing.assert_allclose(acquisition_of(posterior, "uei")(U), by_hand, atol=1e-12)
    np.testing.assert_allclose(np.exp(acquisition_of(posterior, "ulog_ei")(U)), by_hand, atol=1e-12)


def test_robust_improvement_by_hand(posterior):
    offsets, weights = sigma_points(S)
    g = posterior.average(U, offsets, weights)
    by_hand = expected_improvement(g.mean, np.sqrt(g.variance), 0.3).value.mean(axis=0)
    np.testing.assert_allclose(acquisition_of(posterior, "robust_ei")(U), by_hand, atol=1e-12)


def test_incumbent_of_each_particle(posterior):
    best = np.linspace(0.1, 0.5, 10)[:, None]
    moments = posterior.moments(U)
    by_hand = expected_improvement(moments.mean, np.sqrt(moments.variance), best).value.mean(axis=0)
    np.testing.assert_allclose(acquisition_of(posterior, "ei", best=best)(U), by_hand, atol=1e-12)


def test_negative_center_weight_gives_minus_infinity_where_the_sum_is_negative(posterior):
    acquisition = acquisition_of(posterior, "ulog_ei", k=-1.9)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 15)), axis=-1).reshape(-1, 2)
    values, plain = acquisition(grid), acquisition_of(posterior, "uei", k=-1.9)(grid)
    assert np.array_equal(np.isfinite(values), plain > 0.0)
    assert (plain <= 0.0).any()
    assert not acquisition.with_gradient(grid[[int(np.argmin(plain))]])[1].any()


@pytest.mark.parametrize("name", ["eii", "robust", "", "u", "robust_uei", "upi", "uucb"])
def test_unknown_name(name):
    with pytest.raises(InputError, match="is unknown"):
        criterion_name(name)


@pytest.mark.parametrize("base", ["thompson", "eii", ""])
def test_a_criterion_without_a_formula_is_refused(base, posterior):
    """It was evaluated as an upper confidence bound."""
    with pytest.raises(InputError, match=f"acquisition function '{base}' is unknown"):
        Acquisition(posterior, CriterionName(base, "exact"), Perturbations(exact(2)), 0.0)


@pytest.mark.parametrize("scale", ["exact", "robust"])
def test_probability_and_bound_by_scipy(scale, posterior):
    offsets, weights = exact(2) if scale == "exact" else sigma_points(S)
    g = posterior.average(U, offsets, weights)
    std = np.sqrt(g.variance)
    expected = {"pi": norm.sf(0.3, g.mean, std).mean(axis=0), "ucb": (g.mean + 2.0 * std).mean(axis=0)}
    for base, values in expected.items():
        found = Acquisition(posterior, CriterionName(base, scale), Perturbations(Quadrature(offsets, weights)), 0.3)(U)
        np.testing.assert_allclose(found, values, atol=1e-12, err_msg=base)


def test_natures(posterior):
    """An improvement is multiplied by a probability, its logarithm gains the logarithm; a bound has no zero."""
    natures = {name: acquisition_of(posterior, name).nature for name in ("ei", "pi", "ulog_ei", "robust_ucb")}
    assert natures == {"ei": "improvement", "pi": "improvement", "ulog_ei": "logarithm", "robust_ucb": "bound"}


@pytest.mark.parametrize("name", ["robust_ei", "uei", "robust_ucb"])
def test_gradients_under_noise_that_varies_know_of_its_change(name, posterior):
    box = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    noise = InputNoise.varying(lambda x: [0.02 + 0.2 * x[0], 0.05])
    acquisition = Acquisition(posterior, criterion_name(name), Perturbations.of(noise, box, "unscented"), 0.3)
    steps = 1e-5 * np.eye(2)
    numeric = [(acquisition(u + steps) - acquisition(u - steps)) / 2e-5 for u in U]
    np.testing.assert_allclose(acquisition.with_gradient(U)[1], numeric, rtol=1e-3, atol=1e-6)
