import warnings

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.maximization import maximize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import BORDERS, Perturbations
from surehold.optimization.noise.quadratures import gauss_hermite, sigma_points
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

S = np.diag([0.01, 0.0025])


@pytest.fixture(scope="module")
def posterior():
    rng = np.random.default_rng(0)
    X = rng.random((20, 2))
    return GaussianProcess().fit(X, np.sin(4 * X[:, 0]) * np.cos(3 * X[:, 1])).posterior


def test_borders():
    points = sigma_points(S)
    U = np.array([[0.05, 0.5]])
    left = np.sqrt(0.03)
    expected = {"extend": 0.05 - left, "clip": 0.0, "keep": 0.05}
    for border in BORDERS:
        around = Perturbations(points, border).around(U)[0]
        assert around[3, 0] == pytest.approx(expected[border], abs=1e-12), border
        np.testing.assert_allclose(around[3, 1], 0.5)
        np.testing.assert_allclose(around[[0, 1, 2, 4]], (U + points.offsets)[[0, 1, 2, 4]])


@pytest.mark.parametrize("border", BORDERS)
def test_outcome_is_the_average_of_the_spread(border, posterior):
    perturbations = Perturbations(gauss_hermite(S, 3), border)
    U = np.array([[0.02, 0.5], [0.5, 0.99], [0.4, 0.6]])
    outcome = perturbations.outcome(posterior, U)
    spread, _ = perturbations.spread(posterior, U)
    average = spread.mean.reshape(-1, 3, 9) @ perturbations.quadrature.weights
    np.testing.assert_allclose(outcome.mean, average, atol=1e-9)


@pytest.mark.parametrize("border", BORDERS)
def test_gradients(border, posterior):
    perturbations = Perturbations(sigma_points(S), border)
    U = np.array([[0.05, 0.5], [0.5, 0.97], [0.4, 0.6]])
    h = 1e-6
    found = perturbations.outcome(posterior, U, gradient=True)
    for k, step in enumerate(h * np.eye(2)):
        up, down = perturbations.outcome(posterior, U + step), perturbations.outcome(posterior, U - step)
        np.testing.assert_allclose(found.mean_gradient[:, :, k], (up.mean - down.mean) / (2 * h), atol=1e-5)
        np.testing.assert_allclose(found.variance_gradient[:, :, k], (up.variance - down.variance) / (2 * h), atol=1e-5)
    spread, slopes = perturbations.spread(posterior, U, gradient=True)
    slopes = np.ones((3, 5, 2)) if slopes is None else slopes
    for k, step in enumerate(h * np.eye(2)):
        up, down = perturbations.spread(posterior, U + step)[0], perturbations.spread(posterior, U - step)[0]
        chain = spread.mean_gradient[:, :, k] * slopes[:, :, k].ravel()
        np.testing.assert_allclose(chain, (up.mean - down.mean) / (2 * h), atol=1e-5)


def test_average_of_the_model_by_plain_sampling(posterior):
    rng = np.random.default_rng(1)
    u = np.array([0.4, 0.5])
    small = S / 4
    mean = Perturbations(gauss_hermite(small, 7)).outcome(posterior, u[None, :]).mean[:, 0]
    draws = posterior.moments(u + rng.multivariate_normal(np.zeros(2), small, 40_000)).mean
    assert np.all(np.abs(draws.mean(axis=1) - mean) < 5 * draws.std(axis=1) / 200)


@pytest.mark.parametrize("noise", [InputNoise.unit(0.1), InputNoise.varying(lambda x: [0.1, 0.2, 0.0])])
@pytest.mark.parametrize("border", BORDERS)
def test_slopes_of_the_perturbed_points_are_differences(border, noise):
    """Also under a condition that nobody sets, whose values the query does not move."""
    box = Box({"a": (0.0, 1.0), "b": (0.0, 1.0), "w": (0.0, 1.0)}, uncontrolled={"w": [0.2, 0.7]})
    perturbations = Perturbations.of(noise, box, "unscented", border)
    U, h = np.array([[0.03, 0.5, 0.4], [0.5, 0.98, 0.1], [0.4, 0.55, 0.9]]), 1e-6
    points, slopes = perturbations.with_slopes(U)
    assert ((points[:2, :, :2] > 0.0) & (points[:2, :, :2] < 1.0)).all() == (border == "keep")
    for k, step in enumerate(h * np.eye(3)):
        difference = (perturbations.around(U + step) - perturbations.around(U - step)) / (2.0 * h)
        np.testing.assert_allclose(slopes[:, :, k], difference[:, :, k], atol=1e-9)


def test_of_a_perturbation_that_leaves_the_box_along_one_variable_the_others_are_kept():
    perturbations = Perturbations(gauss_hermite(S, 3), "keep")
    U = np.array([[0.05, 0.5], [0.5, 0.95]])
    all_of = U[:, None, :] + perturbations.quadrature.offsets
    outside = (all_of < 0.0) | (all_of > 1.0)
    assert np.any(outside.any(axis=2) & (all_of != U[:, None, :]).all(axis=2))
    expected = np.where(outside, U[:, None, :], all_of)
    np.testing.assert_array_equal(perturbations.around(U), expected)
    everything = Perturbations(gauss_hermite(S, 3), "keep", allowed=lambda points: np.ones(len(points), dtype=bool))
    np.testing.assert_allclose(everything.around(U), expected, atol=1e-15)


def test_noise_that_varies_has_its_covariance_under_every_condition():
    half = np.array([[0.01, 0.008, 0.0], [0.008, 0.02, 0.0], [0.0, 0.0, 0.0]])
    box = Box({"a": (0.0, 1.0), "b": (0.0, 1.0), "w": (0.0, 1.0)}, uncontrolled={"w": [0.25, 0.75]})
    perturbations = Perturbations.of(InputNoise.varying(lambda x: half * (1.0 + 2.0 * x[2])), box, "unscented")
    u = np.array([[0.5, 0.5, 0.0]])
    points, weights = perturbations.around(u)[0], perturbations.quadrature.weights
    for condition in (0.25, 0.75):
        met = np.isclose(points[:, 2], condition)
        away, share = (points - u[0])[met, :2], weights[met] / weights[met].sum()
        np.testing.assert_allclose((share[:, None] * away).T @ away, (1.0 + 2.0 * condition) * half[:2, :2], rtol=1e-9)


def test_unknown_border():
    with pytest.raises(InputError, match="extend"):
        Perturbations(sigma_points(S), "bounce")


def test_perturbations_of_noise_that_varies_follow_it():
    box = Box({"a": (0.0, 2.0), "b": (0.0, 1.0)})
    noise = InputNoise.varying(lambda x: [0.1 + 0.1 * x[0], 0.0])
    perturbations = Perturbations.of(noise, box, "unscented")
    around = perturbations.around(np.array([[0.0, 0.5], [1.0, 0.5]]))
    ends = np.array([0.0, 3**0.5, 0.0, -(3**0.5), 0.0])  # b has points, too: it may be noisy elsewhere
    np.testing.assert_allclose(around[0, :, 0], 0.05 * ends, atol=1e-12)
    np.testing.assert_allclose(around[1, :, 0], 1.0 + 0.15 * ends, atol=1e-12)
    np.testing.assert_allclose(around[:, :, 1], 0.5)


def test_perturbations_of_noise_that_varies_have_its_covariance():
    covariance = np.array([[0.01, 0.008], [0.008, 0.02]])
    perturbations = Perturbations.of(InputNoise.varying(lambda x: covariance * x[0]), Box.unit(2), "quasi_monte_carlo")
    u = np.array([[0.5, 0.5]])
    offsets, weights = perturbations.around(u)[0] - u, perturbations.quadrature.weights
    np.testing.assert_allclose((weights[:, None] * offsets).T @ offsets, 0.5 * covariance, rtol=1e-9)


@pytest.mark.parametrize("border", ["clip", "keep"])
def test_closed_forms_know_no_border(border):
    with pytest.raises(InputError, match="'closed_form' is for Gaussian noise"):
        Perturbations.of(InputNoise.unit(0.1), Box.unit(2), "closed_form", border)


@pytest.mark.parametrize("rule", ["unscented", "quasi_monte_carlo"])
def test_noise_that_acts_in_a_small_part_of_the_box_is_met_there(rule):
    noise = InputNoise.varying(lambda x: [0.08, 0.02] if np.all(np.abs(x - 0.2) <= 0.02) else [0.0, 0.0])
    perturbations = Perturbations.of(noise, Box.unit(2), rule)
    inside, outside = perturbations.around(np.array([[0.2, 0.2], [0.6, 0.6]]))
    weights = perturbations.quadrature.weights
    np.testing.assert_allclose(np.sqrt(weights @ (inside - 0.2) ** 2), [0.08, 0.02], rtol=1e-9)
    np.testing.assert_allclose(outside, 0.6)


@pytest.mark.parametrize("noise", ["uniform", "varying"])
def test_the_safe_hill_is_found_under_other_kinds_of_noise(noise):
    """A spike at 0.2 and a hill at 0.7; where the noise is small, the spike is worth its height."""

    def f(x):
        return float(1.5 * np.exp(-0.5 * ((x[0] - 0.2) / 0.01) ** 2) + np.exp(-0.5 * ((x[0] - 0.7) / 0.1) ** 2))

    box = Box({"x": (0.0, 1.0)})
    kinds = {
        "uniform": InputNoise.uniform({"x": 0.06}),
        "varying": InputNoise.varying(lambda x: {"x": 1e-4 if x[0] < 0.5 else 0.05}),
    }
    result = maximize(f, box, n_trials=45, input_noise=kinds[noise], seed=0)
    wanted = {"uniform": 0.7, "varying": 0.2}[noise]
    assert result.recommendation.x[0] == pytest.approx(wanted, abs=0.03)


def test_noise_larger_than_the_box_is_warned_of():
    with pytest.warns(UserWarning, match="standard deviation of 3, 0.6 times the box"):
        Optimizer(Box({"dx": (0.0, 5.0)}), input_noise=InputNoise({"dx": 3.0}))


@pytest.mark.parametrize("deviation", [0.3, 0.6])
def test_noise_that_leaves_the_box_with_every_sigma_point(deviation):
    """At the border rule "keep" no perturbation is left then."""
    box = Box.unit(2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # noise larger than the box is warned of
        optimizer = Optimizer(box, input_noise=InputNoise.unit(deviation), border="keep", n_initial=6, seed=0)
    for _ in range(9):
        x = optimizer.ask()
        optimizer.tell(x, -float(np.square(x - 0.4).sum()))
    assert np.isfinite(optimizer.recommend().mean)


@pytest.mark.parametrize("settings", [{}, {"preset": "thesis"}, {"surrogate": "local_global"}, {"noise": "inferred"}])
@pytest.mark.parametrize("noise", [None, InputNoise.unit(0.1), InputNoise.varying(lambda x: [0.1, 0.1])])
@pytest.mark.parametrize("quadrature", ["bogus", "", 3])
def test_an_unknown_quadrature_is_always_refused(settings, noise, quadrature):
    with pytest.raises(InputError, match="quadrature"):
        Optimizer(Box.unit(2), input_noise=noise, quadrature=quadrature, **settings)
