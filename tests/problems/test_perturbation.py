import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems import GM, RKHS, Function, perturbed_points, robust_score


def test_noise_that_varies_is_drawn_under_each_condition():
    box = Box({"grip": (0.0, 1.0), "load": (0.0, 1.0)}, uncontrolled={"load": [0.2, 0.8]})
    noise = InputNoise.varying(lambda x: {"grip": 0.1 if x[1] > 0.5 else 0.0, "load": 0.0})
    points = perturbed_points([0.5, 0.5], box, noise, 2000, border="extend")
    light, heavy = (points[np.isclose(points[:, 1], load), 0] for load in (0.2, 0.8))
    assert np.all(light == 0.5)
    assert heavy.std() == pytest.approx(0.1, rel=0.1)


def test_score_converges_to_the_closed_form():
    p, noise = GM(), InputNoise.unit(0.05)
    x = [0.45, 0.48]
    score = robust_score(p, x, noise, n=20_000)
    standard_error = p.standard_deviation(x, noise) / np.sqrt(20_000)
    assert score.mean == pytest.approx(p.expectation(x, noise), abs=4 * standard_error)
    assert score.std == pytest.approx(p.standard_deviation(x, noise), rel=0.03)


def test_score_is_what_it_says():
    p = RKHS()
    score = robust_score(p, [0.0776], InputNoise.unit(0.01), n=50, seed=3)
    np.testing.assert_array_equal(score.values, p(score.points))
    assert score.points.shape == (50, 1)
    assert score.mean == np.mean(score.values)
    assert score.std == np.std(score.values, ddof=1)
    assert score.worst == score.values.min() == score.quantile(0.0)
    assert score.n_failed == 0
    again = robust_score(p, [0.0776], InputNoise.unit(0.01), n=50, seed=3)
    np.testing.assert_array_equal(score.values, again.values)


def test_a_coordinate_that_would_leave_the_box_keeps_its_value():
    box = Box({"a": (-1.0, 3.0), "b": (0.0, 10.0)})
    x = np.array([3.0, 5.0])
    points = perturbed_points(x, box, InputNoise({"a": 0.4, "b": 0.5}), n=4000)
    assert box.contains(points, tolerance=0.0)
    kept = points[:, 0] == 3.0
    assert 0.45 < kept.mean() < 0.55
    assert np.all(points[:, 1] != 5.0), "the other coordinate still moves"


def test_full_covariance_and_exact_variables():
    box = Box({"a": (0.0, 2.0), "b": (0.0, 2.0)})
    covariance = np.array([[0.01, 0.008], [0.008, 0.02]])
    points = perturbed_points([1.0, 1.0], box, InputNoise(covariance=covariance), n=40_000)
    np.testing.assert_allclose(np.cov(points.T), covariance, rtol=0.05)
    exact = perturbed_points([1.0, 1.0], box, InputNoise({"a": 0.1, "b": 0.0}), n=50)
    assert np.all(exact[:, 1] == 1.0)
    assert np.std(exact[:, 0]) == pytest.approx(0.1, rel=0.3)


def test_a_function_without_a_box_is_no_problem():
    with pytest.raises(InputError, match=r"has no box; give a problem, such as surehold.problems.Function"):
        robust_score(lambda x: 1.0, [0.5], InputNoise.unit(0.05))


def test_failures_are_counted_not_scored():
    def half(x):
        if x[0] > 0.5:
            raise RuntimeError("fell off the table")
        return np.nan if x[0] < 0.45 else 1.0

    score = robust_score(Function(half, Box.unit(1)), [0.5], InputNoise.unit(0.05), n=200)
    assert 120 < score.n_failed < 160
    assert score.mean == score.worst == 1.0
    assert score.values.size + score.n_failed == 200

    def never(x):
        raise RuntimeError

    lost = robust_score(Function(never, Box.unit(1)), [0.5], InputNoise.unit(0.05), n=3)
    assert lost.n_failed == 3
    assert np.isnan(lost.mean)
    assert np.isnan(lost.quantile(0.5))


@pytest.mark.parametrize("n", [0, -1, 2.5, True, 10**12])
def test_bad_counts(n):
    with pytest.raises(InputError, match="integer from 1 to"):
        robust_score(RKHS(), [0.5], InputNoise.unit(0.01), n=n)


def test_bad_points():
    noise = InputNoise.unit(0.01)
    with pytest.raises(InputError, match="outside"):
        robust_score(RKHS(), [1.5], noise)
    with pytest.raises(InputError, match="one point"):
        robust_score(RKHS(), [[0.5], [0.6]], noise)
    with pytest.raises(InputError, match="level"):
        robust_score(RKHS(), [0.5], noise, n=5).quantile(1.5)


@pytest.mark.parametrize(
    ("noise", "words"),
    [(0.03, r"InputNoise\.unit\(0\.03\)"), ({"x": 0.03}, r"give sh\.InputNoise\(\{'x'"), (None, "is None")],
)
def test_what_is_no_input_noise_names_the_right_call(noise, words):
    p = RKHS()
    for score in (robust_score, lambda p, x, noise: p.expectation(x, noise)):
        with pytest.raises(InputError, match=words):
            score(p, [0.5], noise)


def test_what_nobody_sets_is_drawn():
    loads = np.array([0.2, 0.3, 0.3, 0.8])
    box = Box({"grip": (0.0, 1.0)}, uncontrolled={"load": loads})
    points = perturbed_points([0.4, 0.5], box, None, n=4000)
    assert np.all(points[:, 0] == 0.4)
    shares = [np.mean(points[:, 1] == load) for load in (0.2, 0.3, 0.8)]
    assert shares == pytest.approx([0.25, 0.5, 0.25], abs=0.03)
    strayed = perturbed_points([0.4, 0.5], box, InputNoise({"grip": 0.05, "load": 0.0}), n=4000)
    assert strayed[:, 0].std() == pytest.approx(0.05, rel=0.05)
    assert set(strayed[:, 1]) == {0.2, 0.3, 0.8}
    score = robust_score(Function(lambda x: -((x[0] - x[1]) ** 2), box), [0.4, 0.8], None, n=20_000)
    error = score.std / np.sqrt(20_000)
    assert score.mean == pytest.approx(-np.mean((0.4 - loads) ** 2), abs=4 * error)


def test_an_unknown_border_rule():
    with pytest.raises(InputError, match="border rule of re-queries 'clip' is unknown"):
        perturbed_points([0.5], Box.unit(1), InputNoise.unit(0.1), 3, border="clip")
