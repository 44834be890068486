"""What is stated of the answer: of one execution, and of the mean of many."""

import re

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import gauss_hermite
from surehold.optimization.recommendation import Outcome, expectation_at, in_digits, outside_in_words, recommendation
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

LINE = sh.Box({"x": (-1.0, 1.0)})


def test_one_execution_contains_the_observation_noise_and_the_mean_does_not():
    rng = np.random.default_rng(5)
    optimizer = sh.Optimizer(LINE, noise="inferred", seed=5)
    optimizer.restore(rng.uniform(-1.0, 1.0, (200, 1)), rng.normal(42.0, 0.45, 200))
    best = optimizer.recommend()
    executions = stats.norm(42.0, 0.45)
    assert executions.cdf(best.quantile) == pytest.approx(0.05, abs=0.02)
    assert best.probability_below(41.5) == pytest.approx(executions.cdf(41.5), abs=0.04)
    assert best.std == pytest.approx(0.45, rel=0.1)
    assert best.expectation.std < 0.15
    assert best.expectation.quantile(0.005) < 42.0 < best.expectation.quantile(0.995)


@pytest.mark.parametrize("level", [-0.1, 5, 95.0, float("nan"), None, "0.05", True])
def test_a_quantile_is_of_a_share_of_executions(level):
    outcome = Outcome(np.array([1.0, 2.0]), np.array([0.5, 0.5]))
    with pytest.raises(InputError, match="give a share of executions from 0 to 1"):
        outcome.quantile(level)
    assert outcome.quantile(np.float64(0.5)) == pytest.approx(1.5)


def test_known_noise_widens_one_execution_by_its_variance():
    exact, noisy = (sh.Optimizer(LINE, noise=level, seed=1) for level in (1e-9, 0.3))
    X = np.linspace(-1.0, 1.0, 12)[:, None]
    for optimizer in (exact, noisy):
        optimizer.restore(X, np.cos(2.0 * X[:, 0]))
    best = noisy.recommend()
    assert best.std**2 == pytest.approx(best.expectation.std**2 + 0.3**2, rel=1e-6)
    assert exact.recommend().std < 1e-3


def test_under_input_noise_one_execution_strays_and_the_mean_does_not():
    noise = sh.InputNoise({"x": 0.1})
    optimizer = sh.Optimizer(LINE, input_noise=noise, seed=2)
    X = np.linspace(-1.0, 1.0, 25)[:, None]
    optimizer.restore(X, np.sin(3.0 * X[:, 0]))
    best = optimizer.recommend()
    reached = best.x[0] + 0.1 * np.random.default_rng(0).standard_normal(20_000)
    values = np.sin(3.0 * reached)
    assert best.mean == pytest.approx(values.mean(), abs=2e-3)
    assert best.std == pytest.approx(values.std(), rel=0.05)
    assert best.expectation.mean == pytest.approx(best.mean, abs=1e-6)
    assert best.expectation.std < 0.1 * best.std


@pytest.mark.parametrize("border", ["extend", "clip", "keep"])
@pytest.mark.parametrize("top", [1.0, 0.8, 0.0])
def test_it_is_stated_how_many_executions_leave_the_box(border, top):
    noise = sh.InputNoise({"x": 0.2, "y": 0.01})
    box = sh.Box({"x": (-1.0, 1.0), "y": (0.0, 1.0)})
    optimizer = sh.Optimizer(box, input_noise=noise, border=border, seed=0)
    X = np.array([(x, y) for x in np.linspace(-1.0, 1.0, 6) for y in (0.2, 0.5, 0.8)] + [(top, 0.5)])
    optimizer.restore(X, -((X[:, 0] - top) ** 2) - (X[:, 1] - 0.5) ** 2)
    best = optimizer.recommend()
    share = stats.norm.sf(1.0, best.x[0], 0.2) + stats.norm.cdf(-1.0, best.x[0], 0.2)
    if border != "extend" or share < 0.01:
        assert best.outside == {}
    else:
        assert best.outside == {"x": pytest.approx(share, abs=0.02)}
    assert bool(outside_in_words(best.outside)) == (best.outside.get("x", 0.0) > 0.2)


def test_only_variables_along_which_many_leave_the_box_are_named():
    assert outside_in_words({}) == outside_in_words({"dx": 0.15}) == ""
    said = outside_in_words({"dx": 0.15, "dy": 0.4837, "dz": 0.25})
    assert "of 100 executions 48 along dy, 25 along dz leave it" in said
    assert "dx" not in said


def test_straying_trials_do_not_count_the_input_noise_twice():
    noise = sh.InputNoise({"x": 0.05})
    rng = np.random.default_rng(3)
    optimizer = sh.Optimizer(LINE, input_noise=noise, noise_while_exploring=True, surrogate="gp", seed=3)
    X = rng.uniform(-1.0, 1.0, (60, 1))
    optimizer.restore(X, np.sin(6.0 * (X[:, 0] + 0.05 * rng.standard_normal(60))))
    best = optimizer.recommend()
    values = np.sin(6.0 * (best.x[0] + 0.05 * np.random.default_rng(0).standard_normal(20_000)))
    twice = float(np.sqrt(2.0) * values.std())
    assert best.std < max(twice, 0.2), "with what trials strayed as observation noise it would be 0.3 and more"


@pytest.mark.parametrize(("direction", "sign"), [("maximize", 1.0), ("minimize", -1.0)])
def test_the_best_value_told_from_outside_of_the_box_is_named_and_refused(direction, sign):
    optimizer = sh.Optimizer(LINE, input_noise=sh.InputNoise({"x": 0.01}), direction=direction, seed=0)
    for x, reached in ((-0.5, -0.5), (0.0, 0.0), (0.5, 0.5), (0.9, 1.2)):
        optimizer.tell([x], sign * reached, reached=[reached])
    best = optimizer.recommend()
    extreme = "highest" if direction == "maximize" else "lowest"
    assert best.x[0] == pytest.approx(0.5)
    assert best.refused == f"The {extreme} observed trial gave {sign * 1.2:g}, but reached a place outside of the box."
    assert optimizer.feasible.tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (293.1532, 0.05, "293.153"),
        (1e6 + 0.0026, 0.014, "1000000.003"),
        (0.123456, 0.05, "0.1235"),
        (-5.0, 0.0, "-5"),
        (1e300, 1e-300, "1e+300"),
        (np.nan, 1.0, "nan"),
        (1.0, np.inf, "1"),
    ],
)
def test_a_value_is_said_to_a_tenth_of_its_deviation(value, deviation, text):
    assert in_digits(value, deviation) == text


def refused_by_value_at_risk(response, x):
    """Return why the highest of these trials is refused: they are told, so that no search decides what is found."""
    box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.03)
    optimizer = sh.Optimizer(box, input_noise=noise, risk="var", seed=0)
    optimizer.restore(x[:, None], response(x))
    return optimizer.recommend().refused


def test_why_the_highest_is_refused_is_said_by_the_measure_that_decided():
    def spike_and_hill(x):
        return 1.5 * np.exp(-0.5 * ((x - 0.2) / 0.01) ** 2) + np.exp(-0.5 * ((x - 0.7) / 0.1) ** 2)

    refused = refused_by_value_at_risk(spike_and_hill, np.r_[np.linspace(0.0, 1.0, 21), 0.18, 0.19, 0.21, 0.22])
    assert "its 10 % quantile is" in refused
    of_highest, of_recommended = (float(number) for number in re.findall(r"(?:is|one) (-?[\d.]*\d)", refused)[-2:])
    assert of_highest < of_recommended


def test_one_that_is_worth_as_much_by_the_measure_is_said_to_be():
    """The hill is steeper on its right, by so little that .5005 is higher than .5 and worth .0001 less of 10.878."""

    def hill(x):
        return 11.0 - 50.0 * (x - 0.5003) ** 2 - 40.0 * (x - 0.5003) ** 3

    refused = refused_by_value_at_risk(hill, np.r_[np.linspace(0.0, 1.0, 41), 0.5005])
    assert "is worth no more than the recommended one: its 10 % quantile is 10.878, too" in refused


@pytest.mark.parametrize(("direction", "sign"), [("maximize", 1.0), ("minimize", -1.0)])
def test_what_the_answer_is_worth_by_the_measure_is_stated_with_it(direction, sign):
    """A sure model of a parabola: the mean less two variances of (x + e)^2 is a noncentral chi-squared one's."""
    noise, x = 0.05, np.linspace(-1.0, 1.0, 41)
    risk = sh.Risk("mean-variance", beta=2.0)
    box = sh.Box({"x": (-1.0, 1.0)})
    optimizer = sh.Optimizer(box, input_noise=sh.InputNoise({"x": noise}), risk=risk, direction=direction, seed=0)
    optimizer.restore(x[:, None], -sign * x**2)

    def worth(at):
        law = stats.ncx2(1, (at / noise) ** 2)
        return -sign * (noise**2 * law.mean() + 2.0 * noise**4 * law.var())

    assert optimizer.risk == risk
    np.testing.assert_allclose(optimizer.risk_measure([[0.0], [0.5]]), [worth(1e-9), worth(0.5)], rtol=1e-2)
    best = optimizer.recommend()
    assert best.by_risk == best.worth == pytest.approx(optimizer.risk_measure(best.x)[0])
    assert f"by_risk={best.by_risk:.6g}" in repr(best)
    plain = sh.Optimizer(box, input_noise=sh.InputNoise({"x": noise}), seed=0)
    plain.restore(x[:, None], -(x**2))
    assert plain.recommend().by_risk is None
    assert plain.recommend().worth == plain.recommend().mean
    assert plain.risk_measure([[0.0]])[0] == pytest.approx(plain.predict([[0.0]], under_noise=True)[0][0])


@pytest.mark.parametrize("direction", ["maximize", "minimize"])
@pytest.mark.parametrize("noise", [None, "inferred"])
def test_of_an_unsure_model_the_mean_less_nothing_is_the_mean(direction, noise):
    rng, box = np.random.default_rng(2), sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    strays, risk = sh.InputNoise.unit(0.05), sh.Risk("mean-std", beta=0.0)
    optimizer = sh.Optimizer(box, input_noise=strays, risk=risk, direction=direction, noise=noise, seed=0)
    optimizer.restore(rng.random((12, 2)), rng.standard_normal(12))
    best = optimizer.recommend()
    assert best.expectation.std > 0.01
    assert best.by_risk == pytest.approx(best.mean, abs=1e-9)


def test_the_stated_mean_is_as_sure_as_its_average():
    """Of a sine under normal noise the mean is known; the model is sure of it to more digits than 128 points are."""
    noise = 0.04
    optimizer = sh.Optimizer(LINE, input_noise=sh.InputNoise({"x": noise}), seed=0)
    x = np.linspace(0.0, 1.0, 21)
    optimizer.restore(x[:, None], np.sin(9.0 * x))
    best = optimizer.recommend()
    exactly = float(np.sin(9.0 * best.x[0]) * np.exp(-0.5 * (9.0 * noise) ** 2))
    few = Perturbations.of(sh.InputNoise({"x": noise}), LINE, "quasi_monte_carlo", exponent=7)
    coarse = expectation_at(optimizer.posterior, few, best.x)
    assert abs(coarse.mean - exactly) > 10.0 * coarse.std
    assert abs(best.mean - exactly) < 2.0 * best.expectation.std
    assert abs(best.mean - exactly) < 0.5 * abs(coarse.mean - exactly)
    assert best.expectation.std < 3e-3


@pytest.mark.parametrize("border", ["extend", "clip", "keep"])
def test_the_risk_left_to_take_is_the_spread_of_the_mean_over_executions(border):
    """Beside a border some executions are held: three sigma points, one of which is, misjudge the others."""
    noise = sh.InputNoise.uniform({"x": 0.5})
    optimizer = sh.Optimizer(LINE, input_noise=noise, border=border, seed=0)
    X = np.linspace(-1.0, 1.0, 25)[:, None]
    optimizer.restore(X, X[:, 0] ** 3)
    best = optimizer.recommend()
    points = best.x[0] + stats.uniform(-0.5, 1.0).ppf((np.arange(4000) + 0.5) / 4000)
    inside = np.abs(points) <= 1.0
    points = {
        "extend": points,
        "clip": np.clip(points, -1.0, 1.0),
        "keep": np.where(inside, points, best.x[0]),
    }[border]
    assert best.outcome_std == pytest.approx(np.std(optimizer.predict(points[:, None])[0]), rel=0.02)


def test_a_place_that_is_worth_as_much_is_no_worse():
    found = sh.maximize(
        lambda x: x[0] + x[1],
        sh.Box.unit(2),
        n_trials=20,
        allowed=["x1+x2<=1", "x1<=0.2"],
        input_noise=sh.InputNoise.unit(0.03),
        seed=0,
    ).recommendation
    assert not found.refused or "worth no more" in found.refused


def test_a_box_that_is_not_plain_is_shown_by_its_parameters():
    box = sh.Box({"f": (1e-4, 1.0, "log"), "g": ["a", "b"]})
    found = sh.minimize(lambda p: (np.log(p["f"]) + 2.0) ** 2, box, n_trials=12, seed=0).recommendation
    assert repr(found).startswith("Recommendation(parameters={'f': 0.1")


def test_a_mixture_of_narrow_normals_by_scipy():
    means, stds, weights = np.array([0.0, 1.0, 3.0]), np.array([1e-3, 0.2, 1e-4]), np.array([0.2, 0.5, 0.3])
    outcome = Outcome(means, stds, weights)

    def below(value):
        return float(weights @ stats.norm.cdf(value, means, stds))

    for value in (-1e-3, 2e-3, 0.9, 2.9999, 3.00005):
        assert outcome.probability_below(value) == pytest.approx(below(value), abs=1e-12)
    for level in (0.05, 0.4, 0.71, 0.999):
        assert outcome.quantile(level) == pytest.approx(brentq(lambda v, q=level: below(v) - q, -1.0, 4.0), abs=1e-9)
    assert outcome.mean == pytest.approx(weights @ means)
    assert outcome.std**2 == pytest.approx(weights @ (stds**2 + means**2) - (weights @ means) ** 2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_stated_by_hand(sign):
    """Of an unsure model and perturbations of unequal weights: every particle by itself, then their mean."""
    rng = np.random.default_rng(6)
    X = rng.random((6, 2))
    posterior = GaussianProcess(noise=0.1).condition(X, np.sin(6.0 * X[:, 0]) + X[:, 1], rng)
    reached, u = Perturbations(gauss_hermite(np.diag([0.02, 0.01]))), np.array([0.4, 0.6])
    found = recommendation(posterior, reached, None, u, sh.Box.unit(2), 0.3, (u, 0.3), 6, sign)
    points, weights = reached.around(u[None])[0], reached.quadrature.weights
    moments = posterior.moments(points)
    each = np.sqrt(moments.variance + 0.01)

    def below(value):
        return float((stats.norm.cdf(value, moments.mean, each) @ weights).mean())

    expected = (moments.mean @ weights).mean()
    assert found.mean == pytest.approx(sign * expected)
    assert found.expectation.mean == pytest.approx(sign * expected)
    assert found.execution.mean == pytest.approx(sign * expected)
    assert found.quantile == pytest.approx(sign * brentq(lambda v: below(v) - 0.05, -9.0, 9.0), abs=1e-8)
    assert found.observed == sign * 0.3
    curve = moments.mean.mean(axis=0)
    assert found.outcome_std == pytest.approx(np.sqrt(weights @ (curve - weights @ curve) ** 2))
    assert np.ptp(moments.mean @ weights) > 0.01, "the particles must differ for this test to say anything"
