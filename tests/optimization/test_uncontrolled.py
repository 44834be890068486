import numpy as np
import pytest
from scipy import stats

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer


def branin(x):
    a, b = x[..., 0], x[..., 1]
    curve = b - 5.1 / (4.0 * np.pi**2) * a * a + 5.0 / np.pi * a - 6.0
    return -(curve**2 + 10.0 * (1.0 - 1.0 / (8.0 * np.pi)) * np.cos(a) + 10.0)


BRANIN = Box({"a": (-5.0, 10.0), "b": (0.0, 15.0)}, uncontrolled={"b": stats.uniform(0.0, 15.0)})


def test_a_box_knows_the_distribution_of_what_nobody_sets():
    rng = np.random.default_rng(0)
    pairs = rng.multivariate_normal([1.0, 2.0], [[0.04, 0.03], [0.03, 0.04]], 500)
    box = Box({"x": (0.0, 1.0)}, uncontrolled={("mass", "friction"): pairs})
    assert box.names == ("x", "mass", "friction")
    assert box.lower[1:] == pytest.approx(pairs.min(axis=0))
    held = box.uncontrolled
    assert held.held.tolist() == [False, True, True]
    assert np.corrcoef(held.samples.T)[0, 1] == pytest.approx(np.corrcoef(pairs.T)[0, 1])


def test_independent_ones_are_joined():
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"mass": stats.norm(1.0, 0.2), "friction": [0.2, 0.4, 0.4, 0.6]})
    values = box.uncontrolled.values
    assert values.mean(axis=0) == pytest.approx([1.0, 0.4], abs=2e-3)
    assert values.std(axis=0) == pytest.approx([0.2, np.std([0.2, 0.4, 0.4, 0.6])], rel=0.02)
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.02


def test_outcomes_average_over_conditions_and_noise():
    # f = x w + w^2 with w in {1, 2, 4}: E f = x 7/3 + 7, whatever w the query says and however x strays.
    box = Box({"x": (0.0, 2.0), "w": (0.0, 4.0)}, uncontrolled={"w": [1.0, 2.0, 4.0]})
    for noise in (None, InputNoise({"x": 0.1, "w": 0.0})):
        for rule in ("unscented", "quasi_monte_carlo"):
            around = Perturbations.of(noise, box, rule)
            points = box.from_unit(around.around(np.array([[0.3, 0.9]]))[0])
            total = around.quadrature.weights @ (points[:, 0] * points[:, 1] + points[:, 1] ** 2)
            assert total == pytest.approx(0.6 * 7.0 / 3.0 + 7.0, abs=0.15 if rule == "quasi_monte_carlo" else 1e-9)
            if noise is not None:
                spread = around.quadrature.weights @ (points[:, 0] - 0.6) ** 2
                assert spread == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("conditions", ["commanded", "measured"])
def test_branin_with_one_input_random(conditions):
    # Williams, Santner and Notz 2000 choose x for a Branin function whose other input is random.
    optimizer = Optimizer(BRANIN, seed=0, conditions=conditions)
    rng = np.random.default_rng(1)
    for _ in range(28):
        x = optimizer.ask()
        if conditions == "commanded":
            optimizer.tell(x, float(branin(x)))
        else:
            assert x[1] == pytest.approx(7.5)
            b = rng.uniform(0.0, 15.0)
            optimizer.tell(x, float(branin(np.array([x[0], b]))), reached={"b": b})
    b = (np.arange(2000) + 0.5) / 2000 * 15.0

    def true(a):
        return branin(np.stack([np.full(2000, a), b], axis=-1)).mean()

    best = optimizer.recommend()
    assert best.x[1] == pytest.approx(7.5)
    highest = max(true(a) for a in np.linspace(-5.0, 10.0, 301))
    assert true(best.x[0]) > highest - 0.5  # of a range of 150
    assert best.mean == pytest.approx(true(best.x[0]), abs=1.0)


def test_the_worst_case_over_conditions():
    # max over x of min over w of -(x - w)^2 with w in {0.2, 0.8}: x = 0.5.
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"w": [0.2, 0.8]})
    optimizer = Optimizer(box, seed=0, risk="worst")
    for _ in range(20):
        x = optimizer.ask()
        optimizer.tell(x, -float((x[0] - x[1]) ** 2 * (1.0 + x[1])))
    # of the weighted form: (x - .2)^2 1.2 = (.8 - x)^2 1.8
    expected = (0.2 * 1.2**0.5 + 0.8 * 1.8**0.5) / (1.2**0.5 + 1.8**0.5)
    assert optimizer.recommend("box").x[0] == pytest.approx(expected, abs=0.02)


def test_what_was_measured_must_be_told():
    optimizer = Optimizer(BRANIN, conditions="measured", seed=0)
    x = optimizer.ask()
    with pytest.raises(InputError, match=r"says nothing about b, which nobody sets; tell reached=\{'b': value\}"):
        optimizer.tell(x, 1.0)
    with pytest.raises(InputError, match="says nothing about b"):
        optimizer.tell(x, 1.0, reached={"a": 1.0})
    assert len(optimizer.pending) == 1
    optimizer.tell(x, 1.0, reached={"b": 3.0})
    assert optimizer.reached[0] == pytest.approx([x[0], 3.0])


def test_saved_and_loaded(tmp_path):
    optimizer = Optimizer(BRANIN, seed=0)
    for _ in range(12):
        x = optimizer.ask()
        optimizer.tell(x, float(branin(x)))
    optimizer.save(tmp_path / "run.json")
    again = Optimizer.load(tmp_path / "run.json")
    assert again.box == optimizer.box
    assert np.array_equal(again.ask(), optimizer.ask())


@pytest.mark.parametrize(
    ("uncontrolled", "message"),
    [
        ({"x": [0.1, 0.2]}, "all variables are uncontrolled"),
        ({"w": [1.0]}, "two or more finite samples"),
        ({"w": [1.0, 1.0]}, "are equal"),
        ({"w": "heavy"}, "two or more finite samples"),
        ({"w": [1.0, 2.0], ("w", "v"): [[1.0, 2.0], [3.0, 4.0]]}, "names a variable twice"),
        (3, "uncontrolled is 3"),
    ],
)
def test_bad_conditions(uncontrolled, message):
    with pytest.raises(InputError, match=message):
        Box({"x": (0.0, 1.0)}, uncontrolled=uncontrolled)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ((1.0, 1000.0, "log"), r"'w' is uncontrolled, but logarithmic; its bounds are \(1, 1000\) alone"),
        ((0, 5, "int"), "'w' is uncontrolled, but in steps"),
        ((0.0, 5.0, "step=0.5"), "'w' is uncontrolled, but in steps"),
        (["light", "heavy"], "'w' is uncontrolled, but a choice"),
    ],
)
def test_what_nobody_sets_is_a_plain_number(bounds, message):
    with pytest.raises(InputError, match=message):
        Box({"x": (0.0, 1.0), "w": bounds}, uncontrolled={"w": [1.0, 2.0, 3.0]})


def test_samples_outside_of_the_bounds():
    with pytest.raises(InputError, match="reach from 1 to 3, but its bounds are"):
        Box({"x": (0.0, 1.0), "w": (0.0, 2.0)}, uncontrolled={"w": [1.0, 3.0]})
    with pytest.raises(InputError, match="a criterion of it is"):
        Optimizer(BRANIN, criterion="log_ei")
    with pytest.raises(InputError, match="fixed names 'b', which is uncontrolled"):
        Optimizer(BRANIN, fixed={"b": 3.0})


def test_a_trial_that_the_rig_lost_says_nothing_of_its_condition():
    optimizer = Optimizer(BRANIN, conditions="measured", n_initial=4)
    optimizer.tell(optimizer.ask(), failed="rig")
    assert not len(optimizer.y)


def where_it_goes(x):
    """The noise of x under a load: none at 0.2, a tenth of the box at 0.8."""
    return {"x": 0.1 * (x[1] - 0.2) / 0.6, "load": 0.0}


LOADED = Box({"x": (0.0, 1.0), "load": (0.0, 1.0)}, uncontrolled={"load": [0.2, 0.8]})


def test_noise_that_varies_is_that_under_each_condition():
    optimizer = Optimizer(LOADED, input_noise=InputNoise.varying(where_it_goes), seed=0)
    for x in np.random.default_rng(0).random((30, 2)):
        optimizer.tell(x, -((x[0] - 0.5) ** 2))
    mean, _ = optimizer.predict([[0.5, 0.5]], under_noise=True)
    assert mean[0] == pytest.approx(-(0.0**2 + 0.1**2) / 2.0, rel=0.03)  # that of the mean load is 0.05**2


def test_trials_that_tell_their_condition_alone_have_strayed_in_the_rest():
    noise = InputNoise({"x": 0.05, "load": 0.3})  # a condition is as it is: what is said of its noise is passed over
    settings = {"input_noise": noise, "noise_while_exploring": True, "noise": 0.01, "seed": 0}
    measured, commanded = Optimizer(LOADED, conditions="measured", **settings), Optimizer(LOADED, **settings)
    for x in np.random.default_rng(0).random((12, 2)):
        measured.tell([x[0], 0.5], np.sin(9.0 * x[0]) * x[1], reached={"load": x[1]})
        commanded.tell(x, np.sin(9.0 * x[0]) * x[1])
    X = np.random.default_rng(1).random((9, 2))
    assert np.array_equal(measured.predict(X), commanded.predict(X))


def test_conditions_are_no_input_noise():
    rng = np.random.default_rng(0)
    optimizer = Optimizer(LOADED, conditions="measured", seed=0)
    strays = 0.03 * rng.standard_normal(40)
    for x, stray in zip(rng.random(40), strays, strict=True):
        optimizer.tell([x, 0.5], x, reached={"x": x + stray, "load": rng.choice([0.2, 0.8])})
    covariance = optimizer.estimate_input_noise().unit_covariance(LOADED)
    assert covariance == pytest.approx(np.diag([np.mean(strays**2), 0.0]))
    untold = Optimizer(LOADED, conditions="measured", seed=0)
    for load in (0.2, 0.8, 0.2, 0.8, 0.2, 0.8):
        untold.tell([0.4, 0.5], load, reached={"load": load})
    with pytest.raises(InputError, match="tell reached= with all variables"):
        untold.estimate_input_noise()


def test_a_condition_may_lie_beyond_its_range():
    optimizer = Optimizer(LOADED, conditions="measured", seed=0)
    for x in np.linspace(0.0, 1.0, 6):
        optimizer.tell([x, 0.5], -((x - 0.4) ** 2), reached={"load": 1.3 if x == 0.4 else 0.5})
    best = optimizer.recommend()
    assert best.x[0] == pytest.approx(0.4)
    assert not best.refused, "the best trial was recommended: its condition is not the answer's to choose"


@pytest.mark.parametrize("conditions", ["commanded", "measured"])
def test_a_guess_of_all_that_is_set_is_tried_once(conditions):
    X = Optimizer(LOADED, guess={"x": 0.3}, conditions=conditions, n_initial=9, seed=0).ask(9)
    assert X[0, 0] == 0.3
    assert len(np.unique(X[:, 0])) == 9
