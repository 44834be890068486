"""The skin of a hand: samples on links and palm, and the flat faces of pads."""

import numpy as np

from surehold.grasping import Simulator, default_pose
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.skin import AROUND, PITCH, STATIONS, box_samples, link_samples, palm_samples, skin_samples
from surehold.grasping.object.solids import RoundedBox

# One gripper, its pads as one box each and as five, as two public models of a parallel gripper have them.
ONE = '<geom type="box" size=".008 .004 .008" pos="0 .004 .045"/>'
FIVE = '<geom type="box" size=".008 .004 .008" pos="0 .0055 .045"/>' + "".join(
    f'<geom type="box" size=".003 .002 .003" pos="{x} .002 {z}"/>' for x in (-0.005, 0.005) for z in (0.040, 0.050)
)
GRIPPER = """
<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom type="box" size=".03 .06 .02"/>
  <body name="l" pos="0 0 .03"><joint name="a" type="slide" axis="0 1 0" range="0 .04"/>{pad}</body>
  <body name="r" pos="0 0 .03" quat="0 0 0 1"><joint name="b" type="slide" axis="0 1 0" range="0 .04"/>{pad}</body>
</body></worldbody></mujoco>
"""


def gripper(tmp_path, pad):
    path = tmp_path / "gripper.xml"
    path.write_text(GRIPPER.format(pad=pad))
    config = {
        "name": "gripper",
        "palm": {"body": "palm", "x": [0, 1, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.075]},
        "fingers": {"left": ["a"], "right": ["b"]},
        "preshapes": {"pinch": {"open": {"a": 0.04, "b": 0.04}, "closed": {"a": 0, "b": 0}}},
    }
    return load_hand(path, HandConfig.model_validate(config))


def test_samples_lie_on_the_skin_and_point_outwards():
    radius, length = 0.0065, 0.02
    rows = link_samples(radius, length, True)
    foot = np.column_stack([np.zeros((len(rows), 2)), np.clip(rows[:, 2], 0.0, length)])
    np.testing.assert_allclose(np.linalg.norm(rows[:, :3] - foot, axis=1), radius, atol=1e-12)
    np.testing.assert_allclose(rows[:, :3] - foot, radius * rows[:, 3:], atol=1e-12)
    assert len(link_samples(radius, length, False)) == STATIONS * AROUND
    half = np.array([0.04, 0.0335, 0.015])
    palm = palm_samples(half, 0.006)
    distance, gradient = RoundedBox((0.0, 0.0, 0.0), tuple(half), 0.006).signed_distance(palm[:, :3])
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(gradient, palm[:, 3:], atol=1e-12)


def test_the_faces_of_a_box_are_felt_up_to_their_edges():
    half = np.array([0.008, 0.004, 0.02])
    rows = box_samples(half)
    distance, _ = RoundedBox((0.0, 0.0, 0.0), tuple(half), 0.0).signed_distance(rows[:, :3])
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sum(rows[:, :3] * rows[:, 3:], axis=1), half @ np.abs(rows[:, 3:]).T, atol=1e-12)
    assert {tuple(corner) for corner in np.sign(rows[:, :3][np.all(np.abs(rows[:, :3]) == half, axis=1)])} == {
        (x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)
    }
    front = rows[rows[:, 4] == 1.0]
    assert np.diff(np.unique(front[:, 2])).max() <= PITCH + 1e-12


def test_a_pad_is_felt_where_the_model_has_it(tmp_path):
    hand = gripper(tmp_path, ONE)
    samples = skin_samples(hand)
    frames = link_frames(hand.bases, hand.chains, np.where(hand.upper > hand.lower, 0.01, 0.0))
    body = samples[:, 0].astype(int)
    fingers = body < hand.palm
    frame = frames[body[fingers]]
    placed = np.einsum("mij,mj->mi", frame[:, :, :3], samples[fingers, 1:4]) + frame[:, :, 3]
    left = placed[body[fingers] // hand.radii.shape[1] == 0]  # in the palm frame: x is the body's y, y its -x
    np.testing.assert_allclose(left.min(axis=0), (0.01, -0.008, 0.067), atol=1e-9)
    np.testing.assert_allclose(left.max(axis=0), (0.018, 0.008, 0.083), atol=1e-9)


def test_two_models_of_one_gripper_grasp_alike(tmp_path):
    """Felt on the capsules inside the pads, the five boxes had 1.44 to 1.49 times the quality of the one."""
    qualities = []
    for pad in (ONE, FIVE):
        hand = gripper(tmp_path, pad)
        simulator = Simulator(hand, "bottle")
        poses = [
            default_pose(hand, simulator.object, "right-front", 0.005, (dx, dy, 0, 0, 0, 0))
            for dx, dy in ((0.0, -0.02), (0.0, 0.0), (0.0, 0.01), (0.0, 0.02))
        ]
        qualities.append([simulator.grasp(pose).quality for pose in poses])
    one, five = np.array(qualities)
    held = one > 0.005
    assert held.sum() >= 3
    np.testing.assert_allclose(five[held], one[held], rtol=0.15)
