import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise

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
        (lambda: InputNoise({"a": "much", "b": 1.0}), "finite"),
        (lambda: InputNoise({"a": 0.0, "b": 0.0}), "no noise"),
        (lambda: InputNoise({}), "give"),
        (lambda: InputNoise([0.1, 0.1]), "give"),
        (lambda: InputNoise.unit(0.0), "no noise"),
        (lambda: InputNoise.unit(-0.1), "0 or more"),
        (lambda: InputNoise.unit(np.inf), "finite"),
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


@pytest.mark.parametrize(
    "nonsense", [None, "much", {"dx": -1.0, "dy": 0.1}, [0.1], [np.nan, 0.1], np.eye(3), -np.eye(2)]
)
def test_nonsense_of_a_noise_function_is_named_with_the_place(nonsense):
    noise = InputNoise.varying(lambda x: nonsense)  # the place is named
    with pytest.raises(InputError, match=r"function returned.*dx"):
        noise.unit_covariance(HAND)
    with pytest.raises(InputError, match="function of x"):
        InputNoise.varying("0.1")
