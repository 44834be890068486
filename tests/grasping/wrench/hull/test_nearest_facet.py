"""The compiled expansion: budgets, bounds on the way, and no access outside its arrays."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from surehold.grasping.wrench.hull.nearest_facet import DONE, FLAT, OUTSIDE, SPENT, expand_nearest
from surehold.grasping.wrench.hull.workspace import workspace

NO_CENTERS, NO_AXES = np.zeros((0, 6)), np.zeros((0, 6, 3))


def expanded(wrenches, budget, gap=0.0):
    return expand_nearest(wrenches, NO_CENTERS, NO_AXES, 1e-11, gap, 0.0, False, workspace(budget))


def sphere_points(rng, m):
    w = rng.normal(size=(m, 6))
    return w / np.linalg.norm(w, axis=1)[:, None]


def test_bounds_hold_at_every_budget_and_close_in():
    w = sphere_points(np.random.default_rng(0), 200)
    status, lower, upper, *_ = expanded(w, 1 << 16)
    assert status == DONE
    epsilon, last = upper, -np.inf
    assert upper - lower < 1e-10
    for budget in range(64, 4000, 97):
        status, lower, upper, normal, _, facets = expanded(w, budget)
        assert facets <= budget
        assert status in (DONE, SPENT)
        assert last - 1e-12 <= lower <= epsilon + 1e-12
        assert upper >= epsilon - 1e-12
        assert (w @ normal).max() == pytest.approx(upper, abs=1e-14)
        last = lower


def test_gap_stops_early_with_bounds_that_hold():
    w = sphere_points(np.random.default_rng(1), 300)
    exact = expanded(w, 1 << 16)
    rough = expanded(w, 1 << 16, gap=0.2)
    assert rough[4] < exact[4]
    assert rough[1] <= exact[2] <= rough[2] <= rough[1] + 0.2


def test_no_ball():
    rng = np.random.default_rng(2)
    flat = rng.normal(size=(30, 6)) @ np.diag([1.0, 1, 1, 1, 1, 0])
    for w in (flat, np.add(flat, (0, 0, 0, 0, 0, 3)), np.zeros((9, 6)), np.ones((9, 6))):
        assert expanded(w, 4096)[0] == FLAT
    aside = np.add(rng.normal(size=(30, 6)), (6, 0, 0, 0, 0, 0))
    status, _, upper, normal, *_ = expanded(aside, 4096)
    assert status == OUTSIDE
    assert (aside @ normal).max() == pytest.approx(upper)
    assert upper < 0.0


def test_repetition_is_bit_identical():
    w = sphere_points(np.random.default_rng(3), 150)
    first = expanded(w, 4096)
    for _ in range(3):
        again = expanded(w.copy(), 4096)
        assert again[:3] == first[:3]
        np.testing.assert_array_equal(again[3], first[3])


def test_no_access_outside_the_arrays():
    # Compiled code does not check its indices. Interpreted it does; tight budgets let every array run full.
    code = """
        import numpy as np
        from surehold.grasping.wrench.hull.nearest_facet import FAILED, expand_nearest
        from surehold.grasping.wrench.hull.support import rim_points
        from surehold.grasping.wrench.hull.workspace import workspace
        no_centers, no_axes = np.zeros((0, 6)), np.zeros((0, 6, 3))
        for seed in range(4):
            w = np.random.default_rng(seed).normal(size=(40, 6))
            w /= np.linalg.norm(w, axis=1)[:, None]
            for budget in (64, 70, 128, 256):
                assert expand_nearest(w, no_centers, no_axes, 1e-11, 0.0, 0.0, False, workspace(budget))[0] != FAILED
        for c in range(4, 24):
            axes = np.random.default_rng(c).normal(size=(c, 6, 3)) * 0.3
            for near in (0.0, 1.0, 0.01):
                corners = rim_points(w[:c], axes, 1)
                assert expand_nearest(corners, w[:c], axes, 1e-11, 1e-9, near, False, workspace(256))[0] != FAILED
    """
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
