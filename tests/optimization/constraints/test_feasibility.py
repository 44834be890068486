import numpy as np
import pytest
from scipy.optimize import approx_fprime, check_grad
from scipy.special import log_ndtr, ndtr

from surehold.optimization.box import Box
from surehold.optimization.constraints.feasibility import Succeeds, SuccessModel
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.success import model
from surehold.optimization.surrogates.success.propagation import propagated

RNG = np.random.default_rng(0)
X = RNG.random((24, 2))
OK = X[:, 0] + 0.4 * X[:, 1] < 0.8


def covariance(A, B, length=0.4, s2=6.0):
    r = 5.0**0.5 * np.linalg.norm(A[:, None] - B, axis=2) / length
    return s2 * (1.0 + r + r * r / 3.0) * np.exp(-r) + 1.0


@pytest.mark.parametrize("n", [3, 6, 10])
@pytest.mark.parametrize("s2", [1.0, 10.0])
def test_probability_and_evidence_against_sampling_the_exact_posterior(n, s2):
    # Importance sampling from the prior is exact: p(t) = E prod Phi(t_i f_i) over the prior.
    points, t = X[:n], np.where(OK[:n], 1.0, -1.0)
    U = np.array([[0.2, 0.3], [0.9, 0.8], [0.5, 0.5]])
    together = np.concatenate([points, U])
    joint = covariance(together, together, s2=s2)
    f = np.random.default_rng(1).multivariate_normal(np.zeros(n + 3), joint, 400_000)
    weights = np.exp(log_ndtr(t * f[:, :n]).sum(axis=1))
    expected = (weights[:, None] * ndtr(f[:, n:])).sum(axis=0) / weights.sum()
    sites = propagated(joint[:n, :n], OK[:n].astype(float), np.ones(n), np.full(n, 1e-6), np.zeros(n))
    k = joint[n:, :n]
    v = s2 + 1.0 - np.square(k @ sites.half.T).sum(axis=1)
    assert ndtr(k @ sites.alpha / np.sqrt(1.0 + v)) == pytest.approx(expected, abs=0.01)
    assert sites.log_evidence == pytest.approx(np.log(weights.mean()), abs=0.05)  # EP: 0.024 off


def test_gradients_by_differences():
    model = SuccessModel(X, OK)
    for u in RNG.random((5, 2)):
        assert (
            check_grad(lambda v: model.probability(v[None])[0][0], lambda v: model.probability(v[None], True)[1][0], u)
            < 1e-5
        )
    strays = Perturbations.of(InputNoise.unit(0.1), Box.unit(2), "unscented", "clip")
    noisy, once = Succeeds(model, strays, 2.0), Succeeds(model, strays)
    for u in np.vstack([RNG.random((5, 2)), [0.02, 0.97]]):
        assert noisy.log_probability(u[None])[0] == pytest.approx(2.0 * once.log_probability(u[None])[0])
        error = check_grad(
            lambda v: noisy.log_probability(v[None])[0][0], lambda v: noisy.log_probability(v[None], True)[1][0], u
        )
        assert error < 1e-4


def test_gradients_under_noise_that_varies():
    noise = InputNoise.varying(lambda x: np.array([0.02 + 0.2 * x[0], 0.05 + 0.1 * x[1]]))
    requirement = Succeeds(SuccessModel(X, OK), Perturbations.of(noise, Box.unit(2), "unscented"), 2.0)
    for u in np.array([[0.5, 0.4], [0.3, 0.7], [0.62, 0.55]]):
        slope = approx_fprime(u, lambda v: requirement.log_probability(v[None])[0][0], 1e-6)
        np.testing.assert_allclose(requirement.log_probability(u[None], gradient=True)[1][0], slope, rtol=1e-3)


def test_what_is_said_to_be_likely_is_so_at_least_as_often():
    # Labels of 15 places by a random line: near 0 and 1 the model may be careful, never bold.
    said, is_so = [], []
    for seed in range(20):
        rng = np.random.default_rng([3, seed])
        normal, place = rng.standard_normal(2), rng.uniform(0.3, 0.7, 2)
        points, U = rng.random((15, 2)), rng.random((200, 2))
        said.append(SuccessModel(points, (points - place) @ normal > 0.0).probability(U)[0])
        is_so.append((U - place) @ normal > 0.0)
    p, true = np.concatenate(said), np.concatenate(is_so)
    low, high = p < 0.3, p > 0.7
    assert min(low.sum(), high.sum()) > 200
    assert true[low].mean() < p[low].mean() + 0.02
    assert true[high].mean() > p[high].mean() - 0.02
    assert true[~low & ~high].mean() == pytest.approx(0.5, abs=0.2)


@pytest.mark.parametrize(("places", "times"), [(30, 6), (130, 1)])
def test_repeated_and_many_trials_have_an_edge_as_single_ones(places, times, monkeypatch):
    """Several trials at one place, told apart or put together, beside an edge as sharp as the model knows."""
    monkeypatch.setattr(model, "SUCCESS_PLACES", 100)
    rng = np.random.default_rng(0)
    points = rng.random((places, 2))
    points = points[np.abs(points @ [1.0, 0.4] - 0.8) > 0.05]
    fine = points @ [1.0, 0.4] < 0.8
    P, slopes = SuccessModel(np.repeat(points, times, axis=0), np.repeat(fine, times)).probability(points, True)
    assert P[fine].min() > 0.8
    assert P[~fine].max() < 0.2
    assert np.isfinite(slopes).all()


def run(n, seed, fails, **settings):
    optimizer = Optimizer(Box.unit(2), seed=seed, failures="modelled", **settings)
    for _ in range(n):
        x = optimizer.ask()
        bad = bool(fails(x))
        optimizer.tell(x, None if bad else -((x[0] - 0.6) ** 2) - (x[1] - 0.5) ** 2, failed=bad)
    return optimizer


def test_a_failed_region_is_left_alone_and_the_optimum_found():
    optimizer = run(28, 0, lambda x: np.hypot(x[0] - 0.75, x[1] - 0.5) < 0.13)
    assert optimizer.recommend().observed > -1e-3
    assert np.isnan(optimizer.y[10:]).sum() <= 7


def test_without_failures_nothing_changes():
    plain = Optimizer(Box.unit(2), seed=4)
    modelled = Optimizer(Box.unit(2), seed=4, failures="modelled")
    for _ in range(13):
        x = plain.ask()
        assert np.array_equal(modelled.ask(), x)
        plain.tell(x, float(x[0]))
        modelled.tell(x, float(x[0]))


def test_where_every_trial_failed_new_places_are_tried():
    optimizer = run(16, 1, lambda x: True, n_initial=6)
    U = np.asarray(optimizer.X)
    assert np.linalg.norm(U[:, None] - U, axis=2)[np.triu_indices(16, 1)].min() > 0.08


def test_under_noise_the_answer_keeps_away_from_the_edge():
    # The value rises up to an edge at x1 = 0.7, beyond which executions fail.
    optimizer = Optimizer(Box.unit(2), seed=0, failures="modelled", input_noise=InputNoise.unit(0.04))
    for _ in range(24):
        x = optimizer.ask()
        bad = x[0] > 0.7
        optimizer.tell(x, None if bad else float(x[0] - 0.2 * x[1]), failed=bool(bad))
    assert optimizer.recommend().x[0] < 0.68
