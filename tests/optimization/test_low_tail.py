"""Deep values are compressed where the trials speak for it, and only in the search."""

import numpy as np
import pytest
from scipy.stats import qmc
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

import surehold as sh
from surehold.defaults import LOW_TAIL_FROM, MANY_LEARNT
from surehold.optimization.assembly import assembled
from surehold.optimization.low_tail import LowTail, low_tail_of
from surehold.optimization.surrogates.memory import learnt_from
from surehold.optimization.trials import Trials


def valley(X):
    return -np.exp(6.0 * np.abs(X - 0.3).sum(axis=1))


def ripple(X):
    return np.sin(5.0 * X).sum(axis=1)


def places(n, d, seed=0):
    return qmc.Sobol(d, seed=seed).random(n)


def test_the_map_is_smooth_increasing_and_leaves_the_upper_half():
    tail = LowTail(middle=2.0, size=0.5)
    y = np.linspace(-20.0, 6.0, 400)
    z = tail.apply(y)
    assert np.all(np.diff(z) > 0.0)
    assert np.array_equal(z[y >= 2.0], y[y >= 2.0])
    h = 1e-6
    slopes = (tail.apply(y + h) - tail.apply(y - h)) / (2.0 * h)
    assert np.exp(tail.log_slopes(y)) == pytest.approx(slopes, rel=1e-6)


def test_of_few_trials_nothing_is_said():
    X = places(64, 1)
    y = -np.exp(20.0 * np.abs(X[:, 0] - 0.3))
    found = [low_tail_of(X[:n], y[:n]) is not None for n in (LOW_TAIL_FROM - 1, LOW_TAIL_FROM)]
    assert found == [False, True]


@pytest.mark.parametrize(("response", "compressed"), [(valley, True), (ripple, False)])
def test_it_is_chosen_as_an_independent_process_would(response, compressed):
    X = places(32, 2)
    y = response(X)
    tail = LowTail(float(np.median(y)), float(y.max() - np.median(y)))

    def log_evidence(values):
        unit = (values - values.mean()) / values.std()
        process = GaussianProcessRegressor(ConstantKernel() * Matern([0.3, 0.3], nu=2.5), alpha=1e-8)
        return process.fit(X, unit).log_marginal_likelihood_value_ - len(values) * np.log(values.std())

    gain = log_evidence(tail.apply(y)) + tail.log_slopes(y).sum() - log_evidence(y)
    assert (gain > 0.0) == compressed
    assert low_tail_of(X, y) == (tail if compressed else None)


def test_it_rests_on_the_trials_that_hyperparameters_are_learnt_from():
    """One more trial changes nothing until hyperparameters are learnt anew; of many trials every so manieth judges."""
    X = places(512, 2)
    y = valley(X)
    tails = [low_tail_of(X[:n], y[:n]) for n in (64, 67, 68)]
    assert tails[0] == tails[1] != tails[2]
    k = learnt_from(450)
    judges = y[: k : -(-k // MANY_LEARNT)]
    assert low_tail_of(X[:450], y[:450]) == LowTail(np.median(judges), judges.max() - np.median(judges))


@pytest.mark.parametrize("scale", [1e-100, 1e150])
def test_units_do_not_matter(scale):
    X = places(32, 2)
    one, other = low_tail_of(X, valley(X)), low_tail_of(X, scale * valley(X))
    assert tuple(other) == pytest.approx((scale * one.middle, scale * one.size))


@pytest.mark.parametrize(
    "y", [np.zeros(12), np.r_[-1e300, np.ones(11)], np.r_[-1e300, 1e-300, np.zeros(10)], [1.0, 2.0]]
)
def test_values_that_say_nothing_stay_as_they_are(y):
    y = np.asarray(y)
    assert low_tail_of(places(16, 2)[: len(y)], y) is None


def test_the_model_that_is_shown_is_of_the_values_as_they_were_told():
    optimizer = sh.Optimizer(sh.Box.unit(2), seed=0)
    X = places(32, 2)
    optimizer.restore(X, valley(X))
    deepest = int(np.argmin(valley(X)))
    optimizer.ask()
    assert optimizer.predict(X[[deepest]])[0][0] == pytest.approx(valley(X)[deepest], rel=1e-3)
    assert low_tail_of(X, valley(X)) is not None


def test_a_valley_of_thousands_does_not_blur_the_top():
    """A limit that all trials keep switches the map off; all else is the same."""

    def best(seed, limits):
        optimizer = sh.Optimizer(sh.Box.unit(3), seed=seed, constraints=limits)
        for _ in range(50):
            x = optimizer.ask()
            optimizer.tell(x, float(valley(x[None])[0]), constraints=dict.fromkeys(limits, 0.0))
        return np.log10(-1.0 - optimizer.y.max())

    gains = [best(seed, {"torque": (None, 1.0)}) - best(seed, {"torque": (None, None)}) for seed in range(3)]
    assert np.mean(gains) > 0.2


@pytest.mark.parametrize(
    ("settings", "own"),
    [
        ({}, True),
        ({"surrogate": "gp"}, True),
        ({"criterion": "ucb"}, True),
        ({"input_noise": sh.InputNoise.unit(0.05)}, False),
        ({"noise": "inferred"}, False),
        ({"noise": "told"}, False),
        ({"preset": "thesis"}, False),
        ({"surrogate": "tgp"}, False),
        ({"outcome": "success"}, False),
        ({"constraints": {"torque": (None, 1.0)}}, False),
        ({"constraints": {"torque": (None, None)}}, True),
    ],
)
def test_it_is_part_of_searches_for_the_highest_value_alone(settings, own):
    box, X = sh.Box.unit(2), places(32, 2)
    trials = Trials(box)
    for x, y in zip(X, valley(X), strict=True):
        trials.tell(x, y, False, None)
    model = assembled(box, sh.Optimizer(box, **settings)._settings).model
    assert np.array_equal(model.values_of_search(trials), trials.modelled) != own
    assert not own or model.posterior_of_search(trials) is not model.posterior(trials)


def test_where_values_stay_as_they_are_one_model_serves_both():
    box, X = sh.Box.unit(2), places(32, 2)
    trials = Trials(box)
    for x, y in zip(X, ripple(X), strict=True):
        trials.tell(x, y, False, None)
    model = assembled(box, sh.Optimizer(box)._settings).model
    assert model.posterior_of_search(trials) is model.posterior(trials)


def test_it_rests_on_the_trials_and_not_on_when_it_was_first_looked_at():
    """A trial that fills the gap below the others makes an early outlier none, which counts among those that judge."""
    rng = np.random.default_rng(1)
    X = rng.random((32, 1))
    y = np.sin(rng.uniform(3.0, 9.0) * X[:, 0])
    y[4] = -30.0
    running, rebuilt = (sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), n_initial=2, seed=0) for _ in range(2))
    for x, value in zip(X, y, strict=True):
        running.tell(x, value)
    assert running._trials.outliers[4]
    running.forget(running.ask())
    running.tell([0.99], -9.0)
    assert not running._trials.outliers[4]
    rebuilt.restore(running.X, running.y)
    values = [o._model.values_of_search(o._trials) for o in (running, rebuilt)]
    assert np.array_equal(*values)
