import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, noise_of_coordinates
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.samples import representatives
from surehold.optimization.optimizer import Optimizer

RNG = np.random.default_rng(0)
SKEWED = RNG.gamma(1.0, 0.5, (4000, 2)) * [0.1, 0.3]
BIMODAL = np.concatenate([RNG.normal(-0.2, 0.02, 3000), RNG.normal(0.1, 0.03, 1000)])[:, None]


@pytest.mark.parametrize("count", [8, 32, 128])
@pytest.mark.parametrize("samples", [SKEWED, BIMODAL], ids=["skewed", "bimodal"])
def test_representatives_have_the_moments_of_the_samples(samples, count):
    points, weights = representatives(samples, count)
    assert len(points) == count
    assert weights.sum() == pytest.approx(1.0)
    mean = weights @ points
    assert mean == pytest.approx(samples.mean(axis=0), abs=1e-12)
    assert np.sqrt(weights @ (points - mean) ** 2) == pytest.approx(samples.std(axis=0), rel=1e-9)


def test_representatives_average_a_curved_function_as_the_samples_do():
    def f(e):
        return np.exp(-((e - 0.1) ** 2).sum(axis=1) / 0.02) + np.sin(8.0 * e[:, 0])

    for samples in (SKEWED, BIMODAL):
        points, weights = representatives(samples, 32)
        assert weights @ f(points) == pytest.approx(f(samples).mean(), abs=0.02)


def test_few_samples_are_taken_as_they_are():
    points, weights = representatives(SKEWED[:20], 32)
    assert np.array_equal(points, SKEWED[:20])
    assert weights == pytest.approx(np.full(20, 0.05))


def test_sigma_points_keep_mean_and_covariance():
    box = Box({"a": (0.0, 2.0), "b": (0.0, 1.0)})
    around = Perturbations.of(InputNoise.samples(SKEWED), box, "unscented").quadrature
    unit = SKEWED / box.widths
    mean = around.weights @ around.offsets
    assert mean == pytest.approx(unit.mean(axis=0), abs=1e-12)
    apart = around.offsets - mean
    assert (apart.T * around.weights) @ apart == pytest.approx(np.cov(unit.T, bias=True), rel=1e-6, abs=1e-9)


def test_samples_on_a_line_are_noise():
    line = np.outer(np.linspace(-0.1, 0.1, 40), [1.0, 2.0])
    assert len(Perturbations.of(InputNoise.samples(line), Box.unit(2), "unscented").quadrature.weights) == 5


def test_draws_are_samples():
    noise = InputNoise.samples(BIMODAL)
    draws = noise.draws(Box({"a": (0.0, 2.0)}), np.array([0.5]), 500, np.random.default_rng(1))
    assert np.isin(draws[:, 0] * 2.0, BIMODAL[:, 0] / 2.0 * 2.0).all()
    assert (draws[:, 0] * 2.0 < -0.05).mean() == pytest.approx(0.75, abs=0.06)


def test_the_answer_makes_up_for_an_error_that_is_always_on_one_side():
    # Executions fall short by an exponential error: the best command lies beyond the hill of width 0.1 at 0.5.
    errors = -np.random.default_rng(3).gamma(1.0, 0.08, 2000)
    box = Box({"a": (0.0, 1.0)})

    def f(x):
        return np.exp(-0.5 * ((x - 0.5) / 0.1) ** 2)

    optimizer = Optimizer(box, input_noise=InputNoise.samples(errors), seed=0)
    for _ in range(18):
        x = optimizer.ask()
        optimizer.tell(x, f(x[0]))
    grid = np.linspace(0.0, 1.0, 401)
    outcome = np.array([f(a + errors).mean() for a in grid])
    best = optimizer.recommend()
    assert np.interp(best.x[0], grid, outcome) > outcome.max() - 0.01
    assert best.mean == pytest.approx(np.interp(best.x[0], grid, outcome), abs=0.01)
    assert best.std == pytest.approx(f(best.x[0] + errors).std(), abs=0.02)


def test_trials_that_strayed_are_learnt_from_where_the_mean_error_carries_them():
    rng = np.random.default_rng(0)
    errors = 0.1 + 0.01 * rng.standard_normal(50)  # on average a tenth too far
    settings = {"input_noise": InputNoise.samples(errors), "noise_while_exploring": True, "noise": 0.01, "seed": 0}
    optimizer = Optimizer(Box({"a": (0.0, 1.0)}), failures="modelled", **settings)
    for a in np.linspace(0.0, 0.9, 25):
        reached = a + rng.choice(errors)
        optimizer.tell([a], None if reached > 0.8 else reached, failed=bool(reached > 0.8))
    mean, _ = optimizer.predict([[0.4]])
    outcome, _ = optimizer.predict([[0.4]], under_noise=True)
    assert mean[0] == pytest.approx(0.4, abs=0.01)  # f(x) = x
    assert outcome[0] == pytest.approx(0.4 + errors.mean(), abs=0.01)
    assert optimizer.recommend().x[0] < 0.7, "from 0.7 on executions reach the places where trials failed"


def test_stored_and_restored():
    noise = InputNoise.samples(SKEWED[:10])
    again = InputNoise.from_json(noise.to_json())
    assert np.array_equal(again.unit_covariance(Box.unit(2)), noise.unit_covariance(Box.unit(2)))


def test_samples_beside_a_choice_keep_their_mean_and_skew():
    box = Box({"g": ["a", "b"], "x": (0.0, 2.0)})
    noise = noise_of_coordinates(InputNoise.samples([0.0, 0.0, 0.0, -0.1]), box)
    drawn = noise.draws(box, np.full(box.dimension, 0.5), 4000, np.random.default_rng(0))
    x = box.names.index("x")
    assert sorted(set(drawn[:, x])) == [-0.05, 0.0]
    assert not np.delete(drawn, x, axis=1).any()


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ([1.0], "two or more rows"),
        ([0.1, 0.1], "2 rows of 1 column for as many variables: an offset is no noise"),
        (np.zeros((10, 2)), "10 rows of 2 columns for as many variables"),
        ([[np.nan]], r"hold \[nan\] in row 0"),
        ([[0.1], [np.nan]], "row 1"),
        (["a", "b"], "no numbers"),
        (np.zeros((3, 2, 2)), "have shape"),
    ],
)
def test_bad_samples(errors, message):
    with pytest.raises(InputError, match=message):
        InputNoise.samples(errors)


def test_samples_that_do_not_fit_the_box_or_the_rule():
    with pytest.raises(InputError, match="have 2 columns, but the box has 1 variables"):
        InputNoise.samples(SKEWED).unit_covariance(Box.unit(1))
    with pytest.raises(InputError, match="gauss_hermite"):
        Perturbations.of(InputNoise.samples(SKEWED), Box.unit(2), "gauss_hermite")
