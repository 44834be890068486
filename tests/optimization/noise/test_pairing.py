import numpy as np
import pytest
from scipy import stats

from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.pairing import under_conditions
from surehold.optimization.noise.perturbations import Perturbations


def pairs_of(variables, conditions, noise=None, exponent=9):
    names = [f"x{i}" for i in range(variables)]
    given = {f"c{i}": stats.norm(0.0, 1.0) for i in range(conditions)}
    box = Box(dict.fromkeys(names, (-8.0, 8.0)) | dict.fromkeys(given, (-8.0, 8.0)), uncontrolled=given)
    noise = noise or InputNoise(dict.fromkeys(names, 1.0) | dict.fromkeys(given, 0.0))
    around = Perturbations.of(noise, box, "quasi_monte_carlo", exponent=exponent)
    points = box.from_unit(around.around(np.full((1, box.dimension), 0.5))[0])
    return points[:, :variables], points[:, variables:], around.quadrature.weights


@pytest.mark.parametrize(
    ("variables", "conditions", "most"), [(1, 1, 0.003), (1, 2, 0.004), (2, 2, 0.005), (4, 1, 0.008)]
)
def test_means_of_what_depends_on_noise_and_conditions_are_better_than_of_random_pairs(variables, conditions, most):
    # E sin(a'X + b'Y + p) = sin(p) exp(-(a'a + b'b) / 2) for standard normal X and Y.
    X, Y, weights = pairs_of(variables, conditions)
    rng = np.random.default_rng(0)
    errors, random = [], []
    for _ in range(60):
        a = rng.normal(size=variables) * 0.8 / variables**0.5
        b = rng.normal(size=conditions) * 0.8 / conditions**0.5
        p = rng.uniform(0.0, 2.0 * np.pi)
        exact = np.sin(p) * np.exp(-0.5 * (a @ a + b @ b))
        errors.append(weights @ np.sin(X @ a + Y @ b + p) - exact)
        random.append(weights @ np.sin(X @ a + rng.permutation(Y) @ b + p) - exact)
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < most
    assert rms < 0.6 * np.sqrt(np.mean(np.square(random)))


def test_each_half_of_the_pair_keeps_its_own_distribution():
    X, Y, weights = pairs_of(2, 1)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ X == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.cov(X.T, aweights=weights, bias=True) == pytest.approx(np.eye(2), abs=1e-9)
    assert weights @ Y[:, 0] == pytest.approx(0.0, abs=0.01)
    assert weights @ Y[:, 0] ** 2 == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(("errors", "loads"), [(5, 40), (40, 3), (7, 900)])
def test_samples_of_both_all_count_by_their_share(errors, loads):
    # E (x + e) w over all combinations, whichever of the two has fewer samples.
    rng = np.random.default_rng(1)
    e, w = rng.normal(0.0, 0.05, errors), rng.gamma(2.0, size=loads)
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"w": w})
    both = InputNoise.samples(np.column_stack([e, np.zeros(errors)]))
    around = Perturbations.of(both, box, "quasi_monte_carlo", exponent=7)
    points = box.from_unit(around.around(np.array([[0.5, 0.5]]))[0])
    weights = around.quadrature.weights
    assert weights @ points[:, 0] == pytest.approx(0.5 + e.mean(), abs=5e-4)
    assert weights @ points[:, 1] == pytest.approx(w.mean(), rel=3e-3)
    assert weights @ (points[:, 0] * points[:, 1]) == pytest.approx((0.5 + e.mean()) * w.mean(), rel=0.01)


def test_few_points_of_other_rules_are_combined_with_each_condition():
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"w": [1.0, 2.0, 4.0]})
    points = Perturbations.of(InputNoise({"x": 0.1, "w": 0.0}), box, "unscented").quadrature
    assert len(points.weights) == 9
    alone = under_conditions(points, box.uncontrolled, "unscented", 7)
    assert len(alone.weights) == 27
