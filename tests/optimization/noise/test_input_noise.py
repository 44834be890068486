import json

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer

BOX = Box({"a": (-1.0, 3.0), "b": (0.0, 10.0)})
HAND = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})


def test_standard_deviations_are_in_the_box_units():
    covariance = InputNoise({"b": 1.0, "a": 0.2}).unit_covariance(BOX)
    np.testing.assert_allclose(covariance, np.diag([0.05**2, 0.1**2]))


def test_full_covariance_scales_with_the_widths():
    rng = np.random.default_rng(0)
    S = np.array([[0.04, 0.03], [0.03, 0.25]])
    reached = rng.multivariate_normal([1.0, 5.0], S, 200_000)
    seen = np.cov(BOX.to_unit(reached).T)
    np.testing.assert_allclose(InputNoise(covariance=S).unit_covariance(BOX), seen, rtol=0.02)


def test_unit_noise_is_the_same_fraction_of_every_width():
    np.testing.assert_allclose(InputNoise.unit(0.03).unit_covariance(BOX), 0.0009 * np.eye(2))


def test_a_variable_may_be_exact():
    np.testing.assert_allclose(InputNoise({"a": 0.4, "b": 0.0}).unit_covariance(BOX), np.diag([0.01, 0.0]))


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: InputNoise(), "not both or neither"),
        (lambda: InputNoise({"a": 1.0}, covariance=np.eye(2)), "not both or neither"),
        (lambda: InputNoise({"a": -1.0, "b": 1.0}), "0 or more"),
        (lambda: InputNoise({"a": np.nan, "b": 1.0}), "finite"),
        (lambda: InputNoise({"a": 3e198, "b": 1.0}), r"3e\+198; .* up to 1e\+150"),
        (lambda: InputNoise({"a": "much", "b": 1.0}), "finite"),
        (lambda: InputNoise({"a": 0.0, "b": 0.0}), "no noise"),
        (lambda: InputNoise({}), "give"),
        (lambda: InputNoise([0.1, 0.1]), "give"),
        (lambda: InputNoise.unit(0.0), "no noise"),
        (lambda: InputNoise.unit(-0.1), "0 or more"),
        (lambda: InputNoise.unit(np.inf), "finite"),
        (lambda: InputNoise.unit([0.0, 0.05]), r"one share .* not \[0.0, 0.05\]; for one "),
        (lambda: InputNoise(covariance=[[1.0, 2.0], [2.0, 1.0]]), "positive definite"),
        (lambda: InputNoise(covariance=[[1.0, 0.0], [0.5, 1.0]]), "symmetric"),
        (lambda: InputNoise(covariance=[[1.0, np.nan], [np.nan, 1.0]]), "finite"),
        (lambda: InputNoise(covariance=[1.0, 2.0]), "square"),
        (lambda: InputNoise(covariance=[["a"]]), "numeric"),
        (lambda: InputNoise({"a": 0.1}).unit_covariance(BOX), "nothing about b"),
        (lambda: InputNoise({"a": 0.1, "b": 0.1, "c": 0.1}).unit_covariance(BOX), "'c' is unknown"),
        (lambda: InputNoise(covariance=np.eye(3)).unit_covariance(BOX), "2 x 2"),
    ],
)
def test_bad_noise(build, words):
    with pytest.raises(InputError, match=words):
        build()


def test_uniform_noise_stays_within_its_half_widths():
    noise = InputNoise.uniform({"dx": 0.003, "dy": 0.006})
    np.testing.assert_allclose(np.sqrt(np.diag(noise.unit_covariance(HAND))), [0.03 / 3**0.5, 0.1 / 3**0.5])
    draws = noise.draws(HAND, np.full(2, 0.5), 20_000, np.random.default_rng(0))
    assert np.all(np.abs(draws) <= [0.03, 0.1])
    np.testing.assert_allclose(draws.std(axis=0), [0.03 / 3**0.5, 0.1 / 3**0.5], rtol=0.02)
    assert noise.bounded
    assert repr(noise) == "InputNoise.uniform({'dx': 0.003, 'dy': 0.006})"
    points, weights = noise.kind.quadrature(HAND, "quasi_monte_carlo", 1.0, 6)[0]
    assert np.all(np.abs(points) <= [0.03, 0.1])
    np.testing.assert_allclose(weights @ points**4, np.array([0.03, 0.1]) ** 4 / 5.0, rtol=0.01)


def test_varying_noise_is_asked_where_it_acts():
    noise = InputNoise.varying(lambda x: {"dx": 0.001 + 0.1 * abs(x[0]), "dy": 0.003})
    assert noise.varies
    np.testing.assert_allclose(np.sqrt(np.diag(noise.unit_covariance(HAND, [0.05, 0.0]))), [0.06, 0.05])
    np.testing.assert_allclose(np.sqrt(np.diag(noise.unit_covariance(HAND))), [0.01, 0.05])
    roots = noise.unit_roots(HAND, np.array([[0.5, 0.5], [1.0, 0.5]]))
    np.testing.assert_allclose(roots, [np.diag([0.01, 0.05]), np.diag([0.06, 0.05])], atol=1e-12)
    far = noise.draws(HAND, np.array([1.0, 0.5]), 5000, np.random.default_rng(0)).std(axis=0)
    np.testing.assert_allclose(far, [0.06, 0.05], rtol=0.05)


def test_varying_noise_may_return_deviations_or_a_covariance():
    S = np.array([[1e-6, 5e-7], [5e-7, 1e-6]])
    for value in ([0.001, 0.002], np.diag([1e-6, 4e-6])):
        noise = InputNoise.varying(lambda x, value=value: value)
        np.testing.assert_allclose(np.sqrt(np.diag(noise.unit_covariance(HAND))), [0.01, 0.002 / 0.06])
    np.testing.assert_allclose(
        InputNoise.varying(lambda x: S).unit_covariance(HAND), InputNoise(covariance=S).unit_covariance(HAND)
    )
    draws = InputNoise.varying(lambda x: S).draws(HAND, np.full(2, 0.5), 20_000, np.random.default_rng(0))
    expected = InputNoise(covariance=S).unit_covariance(HAND)
    np.testing.assert_allclose(np.cov(draws.T), expected, atol=0.02 * np.diag(expected).max())


def test_outside_of_the_box_varying_noise_is_that_of_the_nearest_border():
    def inside_alone(x):
        assert HAND.contains(x), x
        return [0.001 + 0.1 * abs(x[0]), 0.003]

    noise = InputNoise.varying(inside_alone)
    draws = noise.draws(HAND, np.array([1.5, 0.5]), 5000, np.random.default_rng(0))
    np.testing.assert_allclose(draws.std(axis=0), [0.06, 0.05], rtol=0.05)


@pytest.mark.parametrize(
    "nonsense", [None, "much", {"dx": -1.0, "dy": 0.1}, [0.1], [np.nan, 0.1], np.eye(3), -np.eye(2)]
)
def test_nonsense_of_a_noise_function_is_named_with_the_place(nonsense):
    noise = InputNoise.varying(lambda x: nonsense)  # the place is named
    with pytest.raises(InputError, match=r"function returned.*dx"):
        noise.unit_covariance(HAND)
    with pytest.raises(InputError, match="function of x"):
        InputNoise.varying("0.1")


MIXED = Box({"gap_m": (0.0, 1e-3), "T_K": (300.0, 1300.0), "n": (0.0, 1.0)})


@pytest.mark.parametrize(
    "S",
    [
        np.diag([1e-10, 400.0, 1e-4]),
        np.array([[1e-10, 1e-4, 0.0], [1e-4, 400.0, 0.0], [0.0, 0.0, 1e-4]]),
        np.array([[1e-10, 1e-4, 0.0], [1e-4, 400.0, 0.0], [0.0, 0.0, 0.0]]),
        np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]]) * 1e-8,
    ],
)
def test_a_covariance_of_any_units_and_with_exact_variables(S):
    noise = InputNoise(covariance=S)
    np.testing.assert_allclose(noise.unit_covariance(MIXED), S / np.outer(MIXED.widths, MIXED.widths), rtol=1e-14)
    root = noise.unit_roots(MIXED, np.full((1, 3), 0.5))[0] * MIXED.widths[:, None]
    np.testing.assert_allclose(root @ root.T, S, rtol=1e-12, atol=0.0)
    optimizer = Optimizer(MIXED, input_noise=noise, n_initial=5, seed=0)
    for _ in range(6):
        x = optimizer.ask()
        optimizer.tell(x, -float(np.square(MIXED.to_unit(x) - 0.4).sum()))
    assert np.isfinite(optimizer.recommend().mean)


@pytest.mark.parametrize(
    "noise",
    [
        InputNoise({"dx": 0.003, "dy": 0.0}),
        InputNoise.unit(0.04),
        InputNoise.uniform({"dx": 0.003, "dy": 0.006}),
        InputNoise(covariance=[[1e-6, 5e-7], [5e-7, 1e-6]]),
        InputNoise.samples([[0.001, 0.002], [0.0, -0.003], [0.004, 0.0]]),
    ],
    ids=repr,
)
def test_constant_noise_comes_back_from_plain_data(noise):
    found = InputNoise.from_json(json.loads(json.dumps(noise.to_json())))
    assert type(found.kind) is type(noise.kind)
    np.testing.assert_array_equal(found.unit_covariance(HAND), noise.unit_covariance(HAND))
    np.testing.assert_array_equal(found.unit_mean(HAND), noise.unit_mean(HAND))


def test_rounding_between_the_halves_of_a_covariance_is_taken_out():
    noise = InputNoise(covariance=[[1e-6, 1e-17], [5e-17, 1e-6]])
    found = noise.unit_covariance(HAND)
    np.testing.assert_array_equal(found, found.T)
    points, weights = Perturbations.of(noise, HAND, "unscented").quadrature
    np.testing.assert_allclose((weights * points.T) @ points, found, rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize(
    ("S", "words"),
    [
        (np.zeros((2, 2)), "no noise"),
        ([[0.0, 1e-3], [1e-3, 1.0]], "row and a column of zeros"),
        ([[-1.0, 0.0], [0.0, 1.0]], "variance is negative"),
        ([[1e-10, 2e-4], [2e-4, 400.0]], "move exactly together"),
        ([[1e-10, 3e-4], [3e-4, 400.0]], "positive definite"),
    ],
)
def test_what_is_no_covariance(S, words):
    with pytest.raises(InputError, match=words):
        InputNoise(covariance=S)


@pytest.mark.parametrize("bounds", [(0.0, 10.0), (-5.0, 5.0)])
@pytest.mark.parametrize("shape", ["deviation", "covariance"])
def test_noise_proportional_to_the_input_is_none_at_zero(bounds, shape):
    box = Box({"dose": bounds})
    states = {"deviation": lambda x: 0.05 * np.abs(x), "covariance": lambda x: np.outer(0.05 * x, 0.05 * x)}
    noise = InputNoise.varying(states[shape])
    assert not noise.unit_roots(box, box.to_unit([[0.0]])).any()
    around = Perturbations.of(noise, box, "unscented").around(box.to_unit([[0.0], [4.0]]))
    np.testing.assert_allclose(box.from_unit(around[0]), 0.0, atol=1e-12)
    np.testing.assert_allclose(box.from_unit(around[1]).ravel(), 4.0 + 0.2 * np.array([0.0, 2**0.5, -(2**0.5)]))
    optimizer = Optimizer(box, input_noise=noise, n_initial=5, seed=0)
    for x in ([0.0], *box.from_unit(np.linspace(0.0, 1.0, 7)[:, None])):
        optimizer.tell(x, -float((x[0] - 1.0) ** 2))
    optimizer.tell(optimizer.ask(), 0.0)
    assert np.isfinite(optimizer.recommend().mean)


def test_a_noise_function_that_raises_is_named_with_the_place():
    def broken(x):
        return {"dx": 0.001, "dy": [0.003][int(x[0] > 0.0)]}

    with pytest.raises(InputError, match=r"raised IndexError at \{'dx': 0.02, 'dy': 0.01\}: list index") as caught:
        InputNoise.varying(broken).unit_covariance(HAND, np.array([0.02, 0.01]))
    assert isinstance(caught.value.__cause__, IndexError)


def test_a_negative_deviation_is_refused_where_it_is():
    noise = InputNoise.varying(lambda x: 0.05 * x)
    with pytest.raises(InputError, match=r"nonsense at .*dose.*-2.*0 or more"):
        noise.unit_covariance(Box({"dose": (-5.0, 5.0)}), [-2.0])


@pytest.mark.parametrize(
    ("noise", "text"),
    [
        (InputNoise({"a": 0.1, "b": 0.0}), "InputNoise({'a': 0.1, 'b': 0.0})"),
        (InputNoise.unit(0.03), "InputNoise.unit(0.03)"),
        (InputNoise(covariance=np.eye(1)), "InputNoise(covariance=[[1.0]])"),
        (InputNoise.varying(abs), "InputNoise.varying('abs')"),
    ],
)
def test_representations(noise, text):
    assert repr(noise) == text
    assert noise.kind.gaussian == (not noise.varies)
