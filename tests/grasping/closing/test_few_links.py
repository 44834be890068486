"""Hands of one link a finger: nothing may ask for more, and the palm stops the first link as any other."""

import numpy as np
import pytest

from surehold.grasping import Hand, Pose, Preshape, Simulator, shipped_object
from surehold.grasping.hand.model import chain_row

LENGTH, RADIUS, HINGE, TOP = 0.04, 0.005, 0.03, 0.01


@pytest.fixture(scope="module")
def flap():
    """One finger, hinged 30 mm above the middle of a palm whose face is at 10 mm, that folds down onto it."""
    turned = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    tip = np.array([LENGTH, 0.0, 0.0])
    fold = Preshape(np.zeros((1, 1)), np.full((1, 1), 0.25), np.zeros((1, 1)), (0.0, 0.0), (0.0, 0.0), (0.0,))
    return Hand(
        name="flap",
        bases=np.column_stack([turned, [0.0, 0.0, HINGE]])[None],
        chains=chain_row(np.zeros(3), tip, np.column_stack([np.eye(3), tip]))[None, None],
        radii=np.full((1, 1), RADIUS),
        lower=np.zeros((1, 1)),
        upper=np.full((1, 1), 1.5),
        palm_poses=np.column_stack([np.eye(3), np.zeros(3)])[None],
        palm_half_extents=np.array([[0.08, 0.05, TOP]]),
        palm_roundings=np.array([0.002]),
        grasp_center=np.array([0.0, 0.0, 0.05]),
        finger_names=("flap",),
        link_names=("flap link",),
        joint_names=("flap",),
        preshapes={"fold": fold},
    )


def test_the_palm_stops_the_first_link(flap):
    """The lowest point of the link is LENGTH sin q + RADIUS below the hinge: it touches where that is HINGE - TOP."""
    closed = Simulator(flap, shipped_object("mug")).grasp(Pose((1.0, 0.0, 0.0)))
    assert closed.status == "no contact"
    assert closed.joints[0, 0] == pytest.approx(np.arcsin((HINGE - TOP - RADIUS) / LENGTH), abs=5e-4)


def test_a_hand_of_one_link_warms_up(flap):
    for contact in ("graded", "single"):
        Simulator(flap, "mug", contact=contact).warm_up()
