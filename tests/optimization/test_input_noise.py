import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.input_noise import InputNoise

BOX = Box({"a": (-1.0, 3.0), "b": (0.0, 10.0)})


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
