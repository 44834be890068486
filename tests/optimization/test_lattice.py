import numpy as np
import pytest

from surehold.optimization.box import Box
from surehold.optimization.lattice import Lattice, LatticePosterior
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.protocol import means
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess

LEVELS = 5


def snap(U):
    U = np.array(U, dtype=np.float64)
    U[..., 0] = (np.clip(np.floor(U[..., 0] * LEVELS), 0, LEVELS - 1) + 0.5) / LEVELS
    return U


LATTICE = Lattice(snap, np.array([False, True]))


@pytest.fixture(params=[GaussianProcess(), TreedGaussianProcess(min_leaf=8)], ids=["gp", "tgp"])
def posteriors(request):
    rng = np.random.default_rng(0)
    X = snap(rng.random((30, 2)))
    plain = request.param.condition(X, np.sin(3.0 * X[:, 0]) + X[:, 1], np.random.default_rng(1))
    return plain, LatticePosterior(plain, LATTICE)


def test_the_model_is_constant_within_a_cell(posteriors):
    plain, rounded = posteriors
    U = np.random.default_rng(2).random((40, 2))
    for moments in (rounded.moments(U), rounded.moments(snap(U)), rounded.average(U, np.zeros((1, 2)), np.ones(1))):
        assert np.allclose(moments.mean, plain.moments(snap(U)).mean, rtol=0, atol=1e-9)
        assert np.allclose(moments.variance, plain.moments(snap(U)).variance, rtol=0, atol=1e-9)
    assert np.allclose(means(rounded, U), plain.moments(snap(U)).mean, rtol=0, atol=1e-9)


def test_perturbed_points_are_rounded_after_the_perturbation(posteriors):
    plain, rounded = posteriors
    offsets = np.array([[0.0, 0.0], [0.13, 0.02], [-0.09, 0.05]])
    weights = np.array([0.5, 0.25, 0.25])
    U = np.random.default_rng(3).random((9, 2))
    expected = sum(w * plain.moments(snap(U + o)).mean for w, o in zip(weights, offsets, strict=True))
    assert np.allclose(rounded.average(U, offsets, weights).mean, expected, atol=1e-9)


def test_gradients_agree_with_finite_differences(posteriors):
    _, rounded = posteriors
    offsets, weights = np.array([[0.01, 0.02], [-0.03, 0.01]]), np.array([0.4, 0.6])
    u, h = np.array([[0.5, 0.33]]), 1e-6
    exact = rounded.average(u, offsets, weights, gradient=True)
    alone = rounded.moments(u, gradient=True)
    for k in range(2):
        step = h * np.eye(2)[k]
        pair = [rounded.average(u + s * step, offsets, weights) for s in (1, -1)]
        assert np.allclose(exact.mean_gradient[:, :, k], (pair[0].mean - pair[1].mean) / (2 * h), atol=1e-4)
        pair = [rounded.moments(u + s * step) for s in (1, -1)]
        assert np.allclose(alone.mean_gradient[:, :, k], (pair[0].mean - pair[1].mean) / (2 * h), atol=1e-4)


def test_pending_points_and_joint_draws_stand_on_the_lattice(posteriors):
    plain, rounded = posteriors
    points = np.random.default_rng(4).random((3, 4, 2))
    normals = np.random.default_rng(5).standard_normal((6, 4))
    assert np.array_equal(rounded.sample(points, normals), plain.sample(snap(points), normals))
    waiting = np.array([[0.31, 0.7]])
    assert rounded.with_pending(waiting).moments(waiting).variance.max() < 1e-6


@pytest.mark.parametrize("surrogate", ["gp", "tgp"])
@pytest.mark.parametrize("noise", [None, InputNoise.unit(0.05)])
def test_only_points_of_the_lattice_are_asked_and_none_twice(surrogate, noise):
    box = Box({"a": (0.0, 1.0, "step=0.1"), "b": (0.0, 1.0)})
    optimizer = Optimizer(box, n_initial=6, seed=0, surrogate=surrogate, input_noise=noise)
    for _ in range(20):
        x = optimizer.ask_trial().x
        assert np.round(10.0 * x[0]) / 10.0 == pytest.approx(x[0], abs=1e-12)
        optimizer.tell(x, -float((x[0] - 0.7) ** 2 + (x[1] - 0.3) ** 2))
    assert len(np.unique(np.round(optimizer.X, 9), axis=0)) == 20
    for where in ("observed", "box"):
        best = optimizer.recommend(where).x
        assert best[0] == pytest.approx(0.7)
        assert abs(best[1] - 0.3) < 0.05


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("variables", "places"),
    [({"n": (1, 4, "int"), "grip": ["a", "b", "c"]}, 12), ({"grip": ["a", "b", "c"]}, 3), ({"n": (1, 5, "int")}, 5)],
)
def test_every_place_is_tried_before_one_is_tried_again(variables, places, seed):
    optimizer = Optimizer(Box(variables), seed=seed)
    tried = []
    for _ in range(places + 2):
        trial = optimizer.ask_trial()
        tried.append(tuple(trial.parameters.values()))
        optimizer.tell(trial.parameters, float(sum(map(len, map(str, tried[-1])))))
    assert len(set(tried[:places])) == places
    assert set(tried[places:]) <= set(tried[:places])


def test_of_allowed_places_each_is_tried_once():
    optimizer = Optimizer(Box({"n": (1, 4, "int"), "m": (1, 4, "int")}), allowed="n + m <= 4", seed=1)
    tried = []
    for _ in range(6):
        trial = optimizer.ask_trial()
        tried.append(tuple(trial.parameters.values()))
        optimizer.tell(trial.parameters, float(tried[-1][0]))
    assert sorted(tried) == [(n, m) for n in range(1, 4) for m in range(1, 5 - n)]


def test_a_design_larger_than_the_lattice_repeats_what_it_must():
    optimizer = Optimizer(Box({"n": (1, 3, "int")}), n_initial=2000, seed=0)
    tried = []
    for _ in range(5):
        trial = optimizer.ask_trial()
        tried.append(trial.parameters["n"])
        optimizer.tell(trial.parameters, 0.0)
    assert sorted(tried[:3]) == [1, 2, 3]
