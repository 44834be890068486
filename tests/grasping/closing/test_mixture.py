"""Which outcomes a finger's mixture is made of, and by which shares, against the tree of passes written out."""

from types import SimpleNamespace

import numpy as np
import pytest

from surehold.grasping.closing import attempt

DEPTH = 0.006
A, B, C = 0.3, 0.6, 0.5  # shares of three passes


def passing(**links):
    """Return the passes (6, 3) of two fingers of three links: by link its time, and by which share it is a touch."""
    rows = np.tile([np.inf, np.inf, 0.0], (6, 1))
    for name, (time, share) in links.items():
        rows[int(name[-1])] = time, (1.0 - share) * DEPTH, 1.0
    return rows


@pytest.mark.parametrize("adaptive", [True, False])
def test_shares_of_outcomes_are_products_along_the_tree_of_passes(monkeypatch, adaptive):
    """Of the second finger link 3 passes, then link 5; with link 3 held, link 4 passes where it goes on."""
    free = passing(link3=(1.0, A), link5=(2.0, B), link0=(0.5, 0.9))
    held = passing(link3=(1.0, A), link4=(3.0, C)) if adaptive else passing(link3=(1.0, A))
    outcomes = []

    def closed(nodes, frame, hand, bases, palms, motion, adaptive, brush, stop):
        assert brush == DEPTH
        assert np.all(np.isinf(stop[0])), "the other finger is not held"
        return stop[1].copy(), None, held if stop[1, 0] == 1.0 else free, 0

    def felt(nodes, frame, hand, pose, joints, depth, graded, first, last):
        assert (depth, graded, first, last) == (DEPTH, True, 3, 6)
        return joints

    def add_outcome(mixture, outcome, share, first, last):
        outcomes.append((tuple(outcome.tolist()), share))

    for stub in (closed, felt, add_outcome):
        monkeypatch.setattr(attempt, "_closed" if stub is closed else stub.__name__, stub)
    monkeypatch.setattr(attempt, "end_mixture", lambda *arguments: None)
    mix = getattr(attempt._mix_finger, "py_func", attempt._mix_finger)
    hand, rows = SimpleNamespace(radii=np.ones((2, 3))), np.zeros((4, 8))
    never = np.full(3, np.inf)
    mix(1, None, None, hand, None, None, None, None, adaptive, DEPTH, never, free, rows)
    inf = np.inf
    expected = {(inf, inf, inf): (1.0 - A) * (1.0 - B), (2.0, 2.0, 2.0): (1.0 - A) * B}
    if adaptive:
        expected |= {(1.0, inf, inf): A * (1.0 - C), (1.0, 3.0, inf): A * C}
    else:
        expected |= {(1.0, 1.0, 1.0): A}
    assert dict(outcomes) == pytest.approx(expected)
    assert len(outcomes) == len(expected)
    assert sum(share for _, share in outcomes) == pytest.approx(1.0)


def test_passes_at_one_time_are_taken_link_by_link(monkeypatch):
    both = passing(link3=(1.0, A), link4=(1.0, B))
    shares = []
    monkeypatch.setattr(attempt, "_closed", lambda *arguments: (None, None, passing(), 0))
    monkeypatch.setattr(attempt, "felt", lambda *arguments: None)
    monkeypatch.setattr(attempt, "add_outcome", lambda mixture, outcome, share, first, last: shares.append(share))
    monkeypatch.setattr(attempt, "end_mixture", lambda *arguments: None)
    mix = getattr(attempt._mix_finger, "py_func", attempt._mix_finger)
    hand, rows = SimpleNamespace(radii=np.ones((2, 3))), np.zeros((4, 8))
    mix(1, None, None, hand, None, None, None, None, True, DEPTH, None, both, rows)
    assert sorted(shares) == pytest.approx(sorted([A, (1.0 - A) * B, (1.0 - A) * (1.0 - B)]))
    shares.clear()
    mix(1, None, None, hand, None, None, None, None, True, DEPTH, None, passing(link3=(1.0, 0.002)), rows)
    assert sorted(shares) == pytest.approx([0.002, 0.998]), "shares of a thousandth count"


def test_a_finger_that_passes_nothing_keeps_what_it_feels(monkeypatch):
    monkeypatch.setattr(attempt, "felt", None)  # is not asked
    mix = getattr(attempt._mix_finger, "py_func", attempt._mix_finger)
    hand, rows = SimpleNamespace(radii=np.ones((2, 3))), np.ones((4, 8))
    for nothing in (passing(), passing(link1=(1.0, 0.5)), passing(link4=(1.0, 0.0005))):
        mix(1, None, None, hand, None, None, None, None, True, DEPTH, np.zeros(3), nothing, rows)
    np.testing.assert_array_equal(rows, 1.0)
