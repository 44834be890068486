import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.stats import kstest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.constraints.input import Region, checked_rules
from surehold.optimization.lattice import lattice_of
from surehold.optimization.maximization import maximize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer

BOX = Box({"a": (0.0, 2.0), "b": (-1.0, 1.0)})
NONE = np.empty((0, 2))


def region(*rules, box=BOX, known=NONE, lattice=None):
    return Region(box, checked_rules(list(rules)), lattice, 0, known)


def disc(x):
    return (x[0] - 1.0) ** 2 + x[1] ** 2 < 0.25


def test_contains_is_what_the_rules_say():
    allowed = region("a + 2*b <= 1", disc)
    U = np.random.default_rng(0).random((500, 2))
    X = BOX.from_unit(U)
    expected = (X[:, 0] + 2.0 * X[:, 1] <= 1.0) & np.array([disc(x) for x in X])
    assert np.array_equal(allowed.contains(U), expected)
    assert 20 < expected.sum() < 480


def test_an_input_on_the_border_is_allowed_in_spite_of_rounding():
    allowed = region("0.1 <= 0.3*a - 0.7*b <= 0.3")
    for a in np.linspace(0.0, 1.0, 50):
        x = np.array([a, (0.3 * a - 0.3) / 0.7])
        assert allowed.contains(BOX.to_unit(x)[None])[0]


def test_draws_fill_the_region_evenly():
    # In a triangle, (a / 2)^2 of the larger leg is uniform: compared by Kolmogorov and Smirnov's test.
    allowed = region("a - 2*b <= 0", box=Box({"a": (0.0, 2.0), "b": (0.0, 1.0)}))
    U = allowed.draw(400, np.random.default_rng(3))
    assert allowed.contains(U).all()
    assert kstest(U[:, 1] ** 2, "uniform").pvalue > 0.01
    assert kstest(U[:, 0] / U[:, 1], "uniform").pvalue > 0.01


def test_a_narrow_strip_is_found_by_its_linear_constraints():
    allowed = region("0 <= a - b <= 1e-7")
    U = allowed.draw(50, np.random.default_rng(0))
    X = BOX.from_unit(U)
    assert np.all((X[:, 0] - X[:, 1] >= -1e-8) & (X[:, 0] - X[:, 1] <= 1.2e-7))
    assert np.ptp(X[:, 0]) > 0.3


def test_the_first_known_point_is_the_center_of_the_largest_ball():
    """In the right triangle with legs of 1 that has the radius 1 - 1 / sqrt(2)."""
    unit = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    np.testing.assert_allclose(region("a + b <= 1", box=unit).points[0], 1.0 - 0.5**0.5, atol=1e-9)


def test_draws_fill_a_gap_between_walls_that_only_a_function_knows():
    """Chords are shortened from both ends: a walker that draws in a millionth of one would stay where it is."""
    line = Box({"a": (0.0, 1.0)})
    allowed = region(lambda x: 0.5 <= x[0] <= 0.500001, box=line, known=np.array([[0.5000005]]))
    at = allowed.points[np.zeros(300, dtype=int)].copy()
    moved = allowed._step(at, np.random.default_rng(0))
    assert np.mean(moved == at) < 0.02
    assert kstest((moved[:, 0] - 0.5) / 1e-6, "uniform").pvalue > 0.01


def test_points_of_a_design_that_are_not_allowed_are_replaced_by_ones_far_from_all_others():
    allowed = region("a >= 0.1")
    wanted, before = np.array([[0.05, 0.5], [0.0, 0.0], [0.0, 0.0]]), np.array([[0.95, 0.05]])
    found = allowed.design(wanted, before, np.random.default_rng(0))
    np.testing.assert_array_equal(found[0], wanted[0])
    assert allowed.contains(found).all()
    assert np.linalg.norm(found[1] - 1.0) < 0.15, "the corner that is farthest from the two that are there"
    assert pdist(np.concatenate([before, found])).min() > 0.4


def test_a_region_too_small_for_chance_is_found_from_a_known_point():
    def dot(x):
        return bool(np.abs(x - [0.3, 0.7]).max() < 1e-3)

    with pytest.raises(InputError, match=r"no allowed input was found among 16,384 points .* by dot"):
        region(dot)
    allowed = region(dot, known=BOX.to_unit(np.array([[0.3, 0.7]])))
    X = BOX.from_unit(allowed.draw(200, np.random.default_rng(0)))
    assert np.all(np.abs(X - [0.3, 0.7]) < 1e-3)
    assert np.ptp(X, axis=0).min() > 1e-3


def test_contradictory_constraints_are_named():
    with pytest.raises(InputError, match="a <= -1: the linear constraints contradict"):
        region("a <= -1")


def test_points_are_tested_where_they_are_tried():
    held = lattice_of(BOX, {"b": 0.5})
    allowed = region("a + b <= 1", lattice=held)
    U = BOX.to_unit(np.array([[0.4, -1.0], [0.6, -1.0]]))
    assert allowed.contains(U).tolist() == [True, False]


def test_a_function_that_raises_or_answers_nonsense():
    with pytest.raises(InputError, match=r"allowed raised ZeroDivisionError at x = \{'a'"):
        region(lambda x: 1 / 0)
    with pytest.raises(InputError, match=r"returned 0\.3"):
        region(lambda x: 0.3)
    with pytest.raises(InputError, match="allowed is 3"):
        region(3)


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol", "uniform"])
def test_every_trial_and_answer_is_allowed(design):
    asked = []

    def narrow(x):
        return 0.3 < x[0] + x[1] ** 2 < 0.5

    optimizer = Optimizer(BOX, allowed=[narrow, "b >= 0"], design=design, n_initial=8, seed=1, direction="minimize")
    for _ in range(20):
        x = optimizer.ask()
        asked.append(x)
        optimizer.tell(x, (x[0] - 0.2) ** 2 + (x[1] - 0.1) ** 2)
    answers = [optimizer.recommend().x, optimizer.recommend("box").x, *optimizer.ask(3), *asked]
    assert all(narrow(x) and x[1] >= -1e-12 for x in answers)
    # the optimum lies on the border of the region: a = 0.3 - b^2 near (0.2, 0.1), by a fine grid 0.00762
    b = np.linspace(0.0, 0.6, 100_001)
    best = ((0.3 - b**2 - 0.2) ** 2 + (b - 0.1) ** 2).min()
    assert optimizer.recommend().mean - best < 2e-4


def test_the_linear_optimum_is_found_along_the_border():
    optimizer = Optimizer(BOX, allowed="a + b >= 1.5", seed=0, direction="minimize")
    for _ in range(25):
        x = optimizer.ask()
        assert x.sum() >= 1.5 - 1e-9
        optimizer.tell(x, x[0] ** 2 + (x[1] - 0.25) ** 2)
    # the nearest point of the line to (0, 0.25) is (0.625, 0.875), at a squared distance of 0.78125
    assert optimizer.recommend().observed == pytest.approx(0.78125, abs=1e-3)


def test_a_trial_told_outside_of_the_region_is_no_answer():
    optimizer = Optimizer(BOX, allowed="a <= 1", n_initial=3, seed=0)
    optimizer.tell([1.5, 0.0], 5.0)
    with pytest.raises(InputError, match="no trial at an allowed input"):
        optimizer.recommend()
    optimizer.tell([0.5, 0.0], 1.0)
    best = optimizer.recommend()
    assert best.x.tolist() == [0.5, 0.0]
    assert "is not allowed" in best.refused


def test_a_function_that_raises_later_loses_no_trial():
    limit = [10.0]

    def fickle(x):
        return 1.0 / limit[0] > 0.0

    optimizer = Optimizer(BOX, allowed=fickle, n_initial=2, seed=0)
    for _ in range(3):
        optimizer.tell(optimizer.ask(), 1.0)
    limit[0] = 0.0
    with pytest.warns(UserWarning, match="allowed raised ZeroDivisionError at x = .* are not allowed"):
        x = optimizer.ask()
    optimizer.tell(x, 2.0)
    assert len(optimizer.X) == 4
    assert optimizer.recommend().observed == 1.0  # whether the last trial was allowed was never answered
    limit[0] = 1.0
    assert optimizer.ask().shape == (2,)


def test_a_whole_run_survives_a_function_that_raises_in_a_corner():
    def allowed(x):
        return 1.0 / float(x[0] + x[1] + 1.0) < 3.0  # raises where both are lowest

    with pytest.warns(UserWarning, match="allowed raised ZeroDivisionError"):
        result = maximize(lambda x: -x[0] - x[1], Box({"a": (-0.5, 1.0), "b": (-0.5, 1.0)}), 18, allowed=allowed)
    assert len(result.y) == 18
    assert result.recommendation.x.sum() == pytest.approx(-2.0 / 3.0, abs=1e-3)


@pytest.mark.parametrize("border", ["extend", "clip", "keep"])
def test_perturbed_points_obey_the_rule_at_the_border_of_the_region(border):
    allowed = region("a + b <= 1", disc)
    around = Perturbations.of(InputNoise.unit(0.1), BOX, "quasi_monte_carlo", border, allowed=allowed.contains)
    u = np.array([[0.45, 0.3]])
    points = around.around(u)[0]
    free = Perturbations.of(InputNoise.unit(0.1), BOX, "quasi_monte_carlo").around(u)[0]
    inside = allowed.contains(free)
    assert 3 < inside.sum() < len(inside) - 3
    assert points[inside] == pytest.approx(free[inside])
    if border == "extend":
        assert points == pytest.approx(free)
    elif border == "keep":
        assert points[~inside] == pytest.approx(np.repeat(u, (~inside).sum(), axis=0))
    else:  # on the way to where they would have been, and no nearer than a thousandth of it to the border
        assert allowed.contains(points).all()
        share = (points - u)[~inside] / (free - u)[~inside]
        assert share[:, 0] == pytest.approx(share[:, 1])
        assert not allowed.contains(u + (share[:, :1] + 2e-3) * (free - u)[~inside]).any()


@pytest.mark.parametrize("border", ["clip", "keep"])
def test_a_run_with_noise_in_a_region(border):
    optimizer = Optimizer(
        BOX, allowed=disc, input_noise=InputNoise.unit(0.05), border=border, seed=0, direction="minimize", n_initial=6
    )
    for _ in range(10):
        x = optimizer.ask()
        assert disc(x)
        optimizer.tell(x, x[0])
    best = optimizer.recommend("box")
    assert disc(best.x)
    assert best.execution.means.min() > 0.45  # no execution leaves the disc, whose leftmost point is 0.5
