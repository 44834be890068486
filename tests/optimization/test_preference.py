"""An optimizer that is told which of two inputs is better."""

import numpy as np
import pytest
from scipy.special import ndtr

import surehold as sh
from surehold.errors import InputError

BOX = sh.Box({"x": (0.0, 1.0), "y": (0.0, 2.0)})


def utility(x):
    return 5.0 - 40.0 * (x[0] - 0.7) ** 2 - 8.0 * (x[1] - 0.6) ** 2


def run(n, seed, **settings):
    """Compare each new input with the best so far, by a judge who errs."""
    optimizer = sh.Optimizer(BOX, outcome="preference", seed=seed, **settings)
    rng, best = np.random.default_rng(seed), None
    for t in range(n):
        x = optimizer.ask()
        if best is not None:
            won = rng.random() < ndtr((utility(x) - utility(best)) / np.sqrt(2.0))
            optimizer.tell_preference(*((x, best) if won else (best, x)))
        best = x if t == 0 else optimizer.recommend().x
    return optimizer


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_is_preferred_is_found(seed):
    optimizer = run(32, seed)
    answer = optimizer.recommend()
    assert utility(answer.x) > 4.3  # 0.1 and 0.3 from the best input; random inputs have -1.9 in the mean
    assert optimizer.preferred(answer.x, [0.1, 1.8]) > 0.8
    assert 0.0 <= answer.observed <= 1.0


def test_under_noise_a_broad_hill_is_preferred():
    """A judge of what was reached: a narrow peak at 0.2 is higher than a broad hill at 0.7."""

    def good(x):
        return 4.0 * np.exp(-0.5 * ((x - 0.2) / 0.04) ** 2) + 3.0 * np.exp(-0.5 * ((x - 0.7) / 0.15) ** 2)

    optimizer = sh.Optimizer(
        sh.Box({"x": (0.0, 1.0)}), outcome="preference", input_noise=sh.InputNoise.unit(0.08), seed=0
    )
    rng, grid = np.random.default_rng(0), np.linspace(0.0, 1.0, 26)
    for _ in range(120):
        a, b = rng.choice(grid, 2, replace=False)
        better = rng.random() < ndtr((good(a) - good(b)) / np.sqrt(2.0))
        optimizer.tell_preference(*(([a], [b]) if better else ([b], [a])))
    assert abs(optimizer.recommend().x[0] - 0.7) < 0.12


def test_shares_and_repeated_comparisons():
    optimizer = sh.Optimizer(BOX, outcome="preference", seed=0)
    first, second, third = optimizer.ask_trial(3)
    optimizer.tell_preference(first, second)
    optimizer.tell_preference(second, first)
    optimizer.tell_preference(first, second)
    optimizer.tell_preference(third.x, first)
    np.testing.assert_allclose(optimizer.y, [2 / 4, 1 / 3, 1.0])
    assert len(optimizer.pending) == 0
    np.testing.assert_allclose(optimizer.X, [first.x, second.x, third.x])
    p = optimizer.preferred(first.x, second.x)
    assert 0.5 < p < 0.7
    optimizer.tell_preference(first, second)  # of the same inputs: what was concluded is forgotten
    assert optimizer.preferred(first.x, second.x) > p


def test_the_next_trial_follows_from_what_was_told(tmp_path):
    optimizer = run(13, 3)
    optimizer.save(tmp_path / "run.json")
    again = sh.Optimizer.load(tmp_path / "run.json")
    restored = sh.Optimizer(BOX, outcome="preference", seed=3)
    pairs = optimizer._trials.pairs
    restored.restore(optimizer.X, np.zeros(len(optimizer.X)), preferences=pairs, numbers=optimizer._trials.numbers)
    x = optimizer.ask()
    np.testing.assert_allclose(again.ask(), x)
    np.testing.assert_allclose(restored.ask(), x, atol=1e-9)
    np.testing.assert_allclose(again.y, optimizer.y)
    turned = sh.Optimizer(BOX, outcome="preference", seed=3)
    turned.restore(optimizer.X, optimizer.y, preferences=pairs[:, ::-1], numbers=optimizer._trials.numbers)
    assert not np.allclose(turned.ask(), x)


def test_several_are_asked_for_at_once():
    optimizer = run(12, 4)
    points = optimizer.ask(3)
    distances = np.linalg.norm((points[:, None] - points) / BOX.widths, axis=2)[np.triu_indices(3, 1)]
    assert distances.min() > 0.02


def test_bad_input():
    optimizer = sh.Optimizer(BOX, outcome="preference", seed=0)
    x = optimizer.ask()
    for wrong, message in (
        ((x, x), "compared with itself"),
        ((x, [2.0, 0.0]), "lies outside"),
        ((x, [0.5]), "do not fit"),
    ):
        with pytest.raises(InputError, match=message):
            optimizer.tell_preference(*wrong)
    assert len(optimizer.X) == 0, "a bad comparison leaves no trace"
    with pytest.raises(InputError, match=r"told preferences: tell_preference\(better, worse\)"):
        optimizer.tell(x, 1.0)
    with pytest.raises(InputError, match="no trial has given a value"):
        optimizer.recommend()
    with pytest.raises(InputError, match=r"give pairs of different rows of X"):
        optimizer.restore([[0.1, 0.2], [0.3, 0.4]], [0.0, 1.0], preferences=[[0, 2]])
    with pytest.raises(InputError, match="outcome='preference'"):
        sh.Optimizer(BOX).tell_preference(x, [0.1, 0.1])
    for settings in ({"surrogate": "gp"}, {"direction": "minimize"}, {"noise": 0.1}, {"failures": "modelled"}):
        with pytest.raises(InputError, match="cannot be combined with outcome='preference'"):
            sh.Optimizer(BOX, outcome="preference", **settings)
    with pytest.raises(InputError, match="a function gives no preferences"):
        sh.maximize(utility, BOX, 10, outcome="preference")
    with pytest.raises(InputError, match="a study keeps no preferences"):
        sh.Sampler(BOX, outcome="preference")


def test_a_trial_of_another_optimizer_is_not_compared():
    optimizer, other = (sh.Optimizer(BOX, outcome="preference", seed=seed) for seed in (0, 1))
    optimizer.tell_preference(optimizer.ask_trial(), [0.5, 0.5])
    with pytest.raises(InputError, match="belongs to another optimizer"):
        optimizer.tell_preference(other.ask_trial(), [0.9, 0.9])
    assert len(optimizer.X) == 2
