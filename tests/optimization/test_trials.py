import numpy as np
import pytest

from surehold.defaults import ROUNDED
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess
from surehold.optimization.trials import AskedTrial

BOX = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
NOISE = InputNoise({"dx": 0.003, "dy": 0.003})


def ridge(x):
    """Highest near the border dx = 0.05."""
    return float(1.0 - 20.0 * abs(x[0] - 0.048) - 10.0 * abs(x[1]))


def in_both(robust):
    return {"input_noise": NOISE} if robust else {}


# --- which trial was told -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bounds", [(-0.05, 0.05), (0.0, 0.1), (20.0, 20.1), (1e-3, 0.3), (300.0, 301.0), (0.1, 0.7), (-1e6, 1.0)]
)
def test_a_corner_in_single_precision_is_the_corner(bounds):
    box = Box({"a": bounds, "b": bounds})
    for corner in (box.lower, box.upper):
        optimizer = Optimizer(box)
        optimizer.tell(np.float32(corner), 1.0)
        assert np.all(np.abs(optimizer.X - corner) <= box.rounding)
        assert np.all((optimizer.reached >= box.lower) & (optimizer.reached <= box.upper))
    optimizer = Optimizer(box, seed=1)
    for _ in range(14):
        x = np.float32(optimizer.ask())
        optimizer.tell(x, -float(((x - bounds[1]) ** 2).sum()))
    assert len(optimizer.pending) == 0


def test_beyond_rounding_is_outside():
    optimizer = Optimizer(BOX)
    with pytest.raises(InputError, match="outside"):
        optimizer.tell([0.0501, 0.0], 1.0)
    far = Box({"a": (1e6, 1e6 + 1.0)})  # single precision counts in steps of 1/16 here: no excuse for so much
    with pytest.raises(InputError, match="outside"):
        Optimizer(far).tell([1e6 + 1.05], 1.0)


def test_a_message_names_the_point_that_was_given():
    for bounds, value in (((1.0, 5.0, "log"), 7.0), ((0, 5, "int"), 9), ((0.0, 1.0, "step=0.25"), 1.5)):
        box = Box({"k": bounds})
        shown = rf"\{{'k': {value}\}}"
        with pytest.raises(InputError, match=rf"x = {shown} lies outside"):
            Optimizer(box).tell({"k": value}, 1.0)
        with pytest.raises(InputError, match=rf"x = {shown} is not pending"):
            Optimizer(box).forget({"k": value})
        with pytest.raises(InputError, match=rf"initial_points holds {shown}, which is not inside"):
            Optimizer(box, initial_points=[{"k": value}])
    with pytest.raises(InputError, match=r"x = \{'k': inf, 'grip': 'b'\} lies outside"):
        Optimizer(Box({"k": (1.0, 5.0, "log"), "grip": ["a", "b"]})).tell([1e6, 0.0, 1.0], 1.0)
    with pytest.raises(InputError, match=r"X holds \{'n': nan\}"):
        Optimizer(Box({"n": (0, 5, "int")})).restore([[np.nan]], [1.0])


def test_a_rounded_trial_is_the_one_that_was_asked():
    box = Box({"temperature": (20.0, 120.0), "time": (0.5, 10.0)})
    exact, rounded = Optimizer(box, n_initial=10), Optimizer(box, n_initial=10)
    for _ in range(10):
        asked = exact.ask()
        exact.tell(asked, 1.0)
        x = rounded.ask()
        assert np.array_equal(x, asked), "a point of the design was left out"
        rounded.tell(np.round(x, 1), 1.0)
        assert np.array_equal(rounded.X[-1], box.from_unit(box.to_unit(np.round(x, 1)))), "learnt where it was not"
    assert len(rounded.pending) == 0


def test_rounded_trials_told_in_any_order():
    box = Box.unit(2)
    optimizer = Optimizer(box, n_initial=6, seed=2)
    points = optimizer.ask(6)
    for i in (3, 0, 5, 1, 4, 2):
        optimizer.tell(np.round(points[i], 2), float(i))
    assert len(optimizer.pending) == 0
    assert optimizer.y.tolist() == [3.0, 0.0, 5.0, 1.0, 4.0, 2.0]


def test_of_two_near_pending_trials_the_nearer_one_is_told():
    optimizer = Optimizer(Box.unit(1))
    optimizer.restore([], [], pending=[[0.5], [0.5 + 0.5 * ROUNDED]])
    optimizer.tell([0.5 + 0.4 * ROUNDED], 1.0)
    assert optimizer.pending.tolist() == [[0.5]]
    optimizer.tell([0.5 + 1.1 * ROUNDED], 1.0)
    assert optimizer.pending.tolist() == [[0.5]], "farther than the tolerance, and taken for the pending one"


def test_rounded_beyond_the_border_it_is_learnt_from_there():
    optimizer = Optimizer(Box({"a": (0.03, 1.03)}))
    optimizer.restore([], [], pending=[[0.034]])
    optimizer.tell([0.0299], 1.0)
    assert len(optimizer.pending) == 0
    np.testing.assert_allclose(optimizer.X, [[0.034]])
    np.testing.assert_allclose(optimizer.reached, [[0.0299]])


def test_an_asked_trial_knows_its_number():
    box = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    optimizer, plain = (Optimizer(box, n_initial=4, seed=3) for _ in range(2))
    trials = optimizer.ask_trial(3)
    np.testing.assert_array_equal([trial.x for trial in trials], plain.ask(3))
    assert [trial.number for trial in trials] == [0, 1, 2]
    optimizer.tell(trials[1], 1.0, reached=[0.99, 0.01])
    np.testing.assert_array_equal(optimizer.X, [trials[1].x])
    np.testing.assert_allclose(optimizer.reached, [[0.99, 0.01]])
    with pytest.raises(InputError, match="trial 1 is not pending"):
        optimizer.tell(trials[1], 1.0)
    optimizer.tell(AskedTrial(2, trials[2].x), failed=True)  # rebuilt from a number that was stored elsewhere
    optimizer.forget(trials[0])
    assert len(optimizer.pending) == 0
    assert optimizer.ask_trial().number == 0


@pytest.mark.parametrize(
    ("other", "shown"),
    [
        (Optimizer(Box({"n": (1, 9, "int"), "b": (0.0, 1.0)}), initial_points=[{"n": 7, "b": 0.25}]), "'n': 7"),
        (Optimizer(Box({"a": (0.0, 1.0)}), initial_points=[[0.75]]), r"\[0.75\]"),
    ],
)
def test_a_trial_of_another_optimizer_is_refused(other, shown):
    optimizer = Optimizer(Box({"n": (1, 9, "int"), "b": (0.0, 1.0)}), initial_points=[{"n": 2, "b": 0.5}])
    own, foreign = optimizer.ask_trial(), other.ask_trial()
    words = f"trial 0 at .*{shown}.* belongs to another optimizer: here trial 0 is at .*'n': 2, 'b': 0.5"
    with pytest.raises(InputError, match=words):
        optimizer.tell(foreign, 3.0)
    with pytest.raises(InputError, match=words):
        optimizer.forget(foreign)
    assert len(optimizer.y) == 0
    optimizer.tell(AskedTrial(0, np.float32(own.x)), 3.0)
    assert len(optimizer.pending) == 0


def test_a_number_that_was_dropped_is_asked_for_again_and_no_other_twice():
    optimizer = Optimizer(Box.unit(2), n_initial=6, seed=4)
    points = optimizer.ask(3)
    optimizer.forget(points[0])
    assert np.array_equal(optimizer.ask(), points[0])
    assert not any(np.array_equal(optimizer.ask(), point) for point in points)


# --- a failure that is not the point's fault ----------------------------------------------------------------------


@pytest.mark.parametrize("n", [3, 9])
def test_a_fault_of_the_rig_leaves_no_trace(n):
    troubled, calm = (Optimizer(BOX, n_initial=6, seed=5) for _ in range(2))
    for i in range(n):
        if i % 2:
            troubled.tell(troubled.ask(), failed="rig")
            troubled.tell(troubled.ask_trial(), failed="rig")
        x = troubled.ask()
        troubled.tell(x, ridge(x))
        x = calm.ask()
        calm.tell(x, ridge(x))
    assert np.array_equal(troubled.X, calm.X)
    assert np.array_equal(troubled.ask(), calm.ask())
    if n > 6:
        told = calm.y.copy()
        calm.tell(calm.pending[0], failed=True)
        assert np.isnan(calm.y[-1])
        assert np.array_equal(calm.y[:-1], told)


def test_kinds_of_failure():
    optimizer = Optimizer(BOX)
    x = optimizer.ask()
    with pytest.raises(InputError, match="did you mean 'rig'"):
        optimizer.tell(x, failed="rigg")
    with pytest.raises(InputError, match="has no value"):
        optimizer.tell(x, 1.0, failed="rig")
    assert len(optimizer.pending) == 1


# --- reached outside of the box -----------------------------------------------------------------------------------


STRAYING = {"noise_while_exploring": True, "input_noise": NOISE}


@pytest.mark.parametrize("settings", [STRAYING, {"input_noise": NOISE}, {}])
def test_a_hand_that_strays_over_the_border_is_learnt_from(settings):
    rng = np.random.default_rng(1)
    optimizer = Optimizer(BOX, surrogate="gp", seed=0, **settings)
    outside = 0
    for _ in range(25):
        x = optimizer.ask()
        reached = x + 0.003 * rng.standard_normal(2)
        outside += not BOX.contains(reached)
        optimizer.tell(x, ridge(reached), reached=reached)
    assert outside > 2, "the test tests nothing"
    assert len(optimizer.pending) == 0
    np.testing.assert_allclose(optimizer.predict(optimizer.reached)[0], optimizer.y, atol=0.05)
    for where in ("observed", "box"):
        best = optimizer.recommend(where)
        assert BOX.contains(best.x)
        assert best.n == 25
        assert best.x[0] > 0.035


SURROGATES = ["gp", "tgp", "local_global", TreedGaussianProcess(min_leaf=4, trees=2)]


@pytest.mark.parametrize(
    "surrogate", SURROGATES, ids=lambda surrogate: surrogate if isinstance(surrogate, str) else "tree_object"
)
@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.filterwarnings("ignore:The trial is told to have reached")
def test_reached_anywhere_does_no_harm(surrogate, robust):
    """Far away trials, told with the highest and the lowest values, spoil neither the model nor the search."""
    box = Box.unit(2)
    noise = {"input_noise": InputNoise.unit(0.05)} if robust else {}
    optimizer = Optimizer(box, seed=1, n_initial=12, surrogate=surrogate, **noise)
    far = {2: [1.05, 0.5], 5: [-40.0, 3.0], 8: [1e6, -1e6], 11: [1e9, 0.5], 13: [-1e308, 1e308]}
    for i in range(16):
        x = optimizer.ask()
        assert box.contains(x)
        if i in far:
            optimizer.tell(x, (-1.0) ** i * 2.0, reached=far[i])
        else:
            optimizer.tell(x, 1.0 - float(((x - [0.3, 0.6]) ** 2).sum()))
    mean, std = optimizer.predict(np.random.default_rng(0).random((50, 2)))
    assert np.isfinite(mean).all()
    assert np.isfinite(std).all()
    best = optimizer.recommend()
    assert box.contains(best.x)
    assert best.observed < 1.5, "the answer is a place outside of the box"
    assert optimizer.promise() >= 0.0


@pytest.mark.parametrize("criterion", ["ei", "ucb", "thompson", "uei", "robust_thompson"])
@pytest.mark.parametrize("border", ["clip", "keep", "extend"])
def test_every_criterion_and_border_with_trials_outside(criterion, border):
    optimizer = Optimizer(
        Box.unit(1), seed=2, n_initial=4, criterion=criterion, border=border, input_noise=InputNoise.unit(0.05)
    )
    for reached in (-0.2, 0.3, 1.1, 0.7):
        optimizer.tell(optimizer.ask(), 1.0 - (reached - 1.0) ** 2, reached=[reached])
    for _ in range(3):
        x = optimizer.ask()
        assert 0.0 <= x[0] <= 1.0
        optimizer.tell(x, 1.0 - (x[0] - 1.0) ** 2, reached=x + 0.1)
    assert 0.0 <= optimizer.recommend().x[0] <= 1.0


def test_all_trials_outside():
    optimizer = Optimizer(Box.unit(1), n_initial=2, input_noise=InputNoise.unit(0.05))
    for reached in (1.2, -0.1, 1.1):
        optimizer.tell(optimizer.ask(), -reached, reached=[reached])
    assert 0.0 <= optimizer.ask()[0] <= 1.0
    assert optimizer.recommend().x[0] == 0.0, "the nearest point of the box to the best place"


def test_restored_with_trials_outside():
    told, restored = (Optimizer(BOX, seed=6, n_initial=5, **in_both(True)) for _ in range(2))
    rng = np.random.default_rng(1)
    for _ in range(9):
        x = told.ask()
        r = x + 0.02 * rng.standard_normal(2)
        told.tell(x, ridge(r), reached=r)
    restored.restore(told.X, told.y, reached=told.reached)
    assert np.array_equal(restored.reached, told.reached)
    np.testing.assert_allclose(restored.ask(), told.ask(), atol=1e-6)


def test_a_reached_input_of_another_unit_is_said():
    optimizer = Optimizer(BOX, seed=0, n_initial=3, **in_both(True))
    optimizer.tell(optimizer.ask(), 0.2, reached=[0.09, 0.03])  # out of the box, and no farther than it is wide
    optimizer.tell(optimizer.ask(), failed="rig", reached=[0.01, 12.0])  # nothing is learnt of it, and nothing said
    assert not optimizer.recommend().warning
    with pytest.warns(UserWarning, match=r"The trial is told to have reached dy = 12, .* -0\.03 to 0\.03") as told:
        optimizer.tell(optimizer.ask(), 0.4, reached=[0.01, 12.0])  # dy in millimeters
    assert told[0].filename == __file__
    warning = optimizer.recommend().warning
    assert warning.startswith("1 of 2 trials is told to have reached dy = 12,")
    assert warning.endswith("Check the unit of what is reached.")


def test_conditions_and_logarithms_may_be_far_away():
    box = Box({"force": (0.1, 10.0, "log"), "load": (0.0, 1.0)}, uncontrolled={"load": [0.2, 0.4, 0.9]})
    optimizer = Optimizer(box, seed=0)
    optimizer.tell({"force": 1.0, "load": 0.5}, 0.3, reached={"force": 500.0, "load": 70.0})  # within two decades
    assert not optimizer.recommend().warning
    with pytest.warns(UserWarning, match=r"reached force = 2000, .* 0\.1 to 10 than that is wide in logarithms"):
        optimizer.tell({"force": 1.0, "load": 0.5}, 0.3, reached={"force": 2000.0, "load": 0.5})


def test_what_was_reached_is_said_in_digits_that_tell_it_from_the_range():
    """Also where it counts as a million box widths away."""
    optimizer = Optimizer(Box({"x": (4512345.5, 4512346.5)}), seed=0)
    with pytest.warns(UserWarning, match=r"x = 4512349\.25, farther from its range of 4512345\.5 to 4512346\.5 than"):
        optimizer.tell([4512346.0], 0.2, reached=[4512349.25])
    for reached, said in ((1e9, "5512345.5"), (-1e9, "3512345.5")):
        with pytest.warns(UserWarning, match=rf"x = {said} or beyond, farther"):
            optimizer.tell([4512346.0], 0.2, reached=[reached])
