"""Bounds of how links move, against the motion itself in small steps."""

import numpy as np
import pytest

from surehold.grasping.closing.link_speed import begins, lasts, speed, speed_along
from surehold.grasping.hand.kinematics import finger_frames, link_ends
from surehold.grasping.hand.model import CLOSED, chain_row
from surehold.grasping.hand.named import hand_named
from surehold.grasping.hand.synergy import closing_motion


@pytest.mark.parametrize("s1", [0.0, -0.9])
def test_no_link_moves_farther_than_its_bounds(s1):
    hand = hand_named("icub-left")
    motion, reach = np.stack(closing_motion(hand, s1, "power")), hand.reach()
    fingers, joints = hand.radii.shape
    rng = np.random.default_rng(0)
    tightest = np.inf
    for _ in range(60):
        f, k = int(rng.integers(fingers)), int(rng.integers(joints))
        stop = np.where(rng.random(hand.radii.shape) < 0.3, rng.uniform(0.0, CLOSED, hand.radii.shape), np.inf)
        early = float(rng.uniform(0.0, 0.9 * CLOSED))
        across = rng.normal(size=3)
        across /= np.linalg.norm(across)

        def posture(t, stop=stop):
            return np.clip(motion[0] + motion[1] * np.minimum(t, stop), motion[2], motion[3])

        frames = np.empty((joints, 3, 4))
        finger_frames(hand.bases[f], hand.chains[f], posture(early)[f], frames)
        if rng.random() < 0.5:
            across = frames[k, :, 2].copy()  # the axis about which the link bends
        v, w = speed_along(f, k, early, across, motion, stop, reach, hand.chains, frames[:, :, 2].copy())
        start = link_ends(hand.bases, hand.chains, posture(early))[joints * f + k]
        for t in np.linspace(early, CLOSED, 40)[1:]:
            way = link_ends(hand.bases, hand.chains, posture(t))[joints * f + k] - start
            s = t - early
            bound = v * s + 0.5 * w * s * s
            assert np.abs(way @ across).max() <= bound + 1e-12
            assert np.linalg.norm(way, axis=1).max() <= speed(f, k, early, motion, stop, reach) * s + 1e-12
            if bound > 1e-6:
                tightest = min(tightest, bound / max(np.abs(way @ across).max(), 1e-9))
            assert lasts(bound, v, w) == pytest.approx(s, rel=1e-9) or bound == 0.0
    assert tightest < 1.5, "a bound that is never near the truth certifies nothing"


def test_a_link_whose_joints_have_stopped_or_are_at_their_ends_stands_still():
    hand = hand_named("icub-left")
    motion, reach = np.stack(closing_motion(hand, 0.0, "power")), hand.reach()
    turns, across, t = np.zeros((4, 3)), np.array([0.0, 0.0, 1.0]), 1.0
    turns[:, 0] = 1.0
    never, before, after = (np.full(hand.radii.shape, at) for at in (np.inf, t, t + 1e-9))
    for k in range(1, 4):
        assert speed(1, k, t, motion, never, reach) > 0.0
        assert speed(1, k, t, motion, after, reach) == speed(1, k, t, motion, never, reach)
        assert speed(1, k, t, motion, before, reach) == 0.0
        assert speed(1, k, 1e3, motion, never, reach) == 0.0
        assert speed_along(1, k, t, across, motion, before, reach, hand.chains, turns) == (0.0, 0.0)
        assert begins(1, k, motion, np.zeros(hand.radii.shape)) == np.inf


@pytest.mark.parametrize("along", [0, 1, 2])
def test_a_link_that_slides_moves_along_its_axis(along):
    """The bound of a sliding joint holds along every direction; a turning one behind it moves the link by its lever."""
    slide = chain_row(np.zeros(3), np.array([0.0, 0.02, 0.0]), np.eye(3, 4), slides=True)
    turn = chain_row(np.zeros(3), np.array([0.0, 0.05, 0.0]), np.eye(3, 4))
    chains, base = np.stack([slide, turn])[None], np.eye(3, 4)[None]
    motion = np.array([[[0.0, 0.0]], [[0.01, 0.2]], [[0.0, 0.0]], [[0.1, 2.0]]])
    reach, stop = np.array([[[1.0, 1.0], [0.0, 0.05]]]), np.full((1, 2), np.inf)
    turns, across = np.tile([0.0, 0.0, 1.0], (2, 1)), np.eye(3)[along]
    start = link_ends(base, chains, motion[0])
    for k, lever in ((0, 0.0), (1, 0.05)):
        v, w = speed_along(0, k, 0.0, across, motion, stop, reach, chains, turns)
        assert (v, w) == pytest.approx((0.01 + 0.2 * lever * (along != 2), 0.0))
        for s in (0.1, 1.0, 4.0):
            way = link_ends(base, chains, motion[0] + s * motion[1])[k] - start[k]
            assert np.abs(way @ across).max() <= v * s + 1e-12


def test_a_way_that_is_never_gone_lasts_for_ever():
    assert lasts(0.0, 0.0, 0.0) == 0.0
    assert lasts(0.01, 0.0, 0.0) == np.inf
    assert lasts(-0.01, 1.0, 1.0) == 0.0
    assert lasts(0.5, 0.0, 1.0) == pytest.approx(1.0)
    assert lasts(0.5, 2.0, 0.0) == pytest.approx(0.25)


def test_a_link_begins_when_its_first_joint_leaves_its_range():
    hand = hand_named("icub-left")
    motion = np.stack(closing_motion(hand, 0.0, "power"))
    stop = np.full(hand.radii.shape, np.inf)
    for f in range(len(hand.radii)):
        for k in range(hand.radii.shape[1]):
            t = begins(f, k, motion, stop)

            def moves(late, f=f, k=k):
                opened, later = (np.clip(motion[0] + motion[1] * t, motion[2], motion[3]) for t in (0.0, late))
                return not np.array_equal(opened[f, : k + 1], later[f, : k + 1])

            assert t == 0.0 or not moves(min(t, 2.0 * CLOSED) - 1e-9)
            assert t == np.inf or moves(t + 1e-3)
