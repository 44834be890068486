"""Hands in files: frames and joints as MuJoCo has them, and closing from what a file holds."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping import Pose, Simulator, icub_left_hand
from surehold.grasping.closing.attempt import placed as moved_frames
from surehold.grasping.formats import GraspFile, StoredGrasp, read_grasps
from surehold.grasping.formats.gripper import (
    closing_hand,
    described_gripper,
    in_root_frame,
    joint_order,
    palm_pose,
    stored_grasp,
    unknown_frame,
)
from surehold.grasping.formats.writing import write_grasps
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.rating import rated_grasps

MODEL = """
<mujoco><worldbody><body name="wrist" pos="0.1 0.2 0.3" euler="10 20 30"><geom size=".01"/>
  <body name="palm" pos="0 .02 .05" euler="0 40 0"><joint name="tilt" axis="1 0 0" range="10 40"/>
    <geom type="box" size=".02 .05 .01" pos="0 0 -.01"/>
    <body name="r" pos=".05 0 0"><joint name="right" type="slide" axis="-1 0 0" range="0 .05"/>
      <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
    <body name="l" pos="-.05 0 0"><joint name="left" type="slide" axis="1 0 0" range="0 .05"/>
      <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
  </body></body></worldbody></mujoco>
"""
CONFIG = {
    "name": "gripper",
    "palm": {"body": "palm", "x": [0, 1, 0], "z": [0, 0, 1], "origin": [0, 0.01, 0.002], "grasp_center": [0, 0, 0.05]},
    "fingers": {"left": ["left"], "right": ["right"]},
    "preshapes": {"pinch": {"closed": {"left": 0.05, "right": 0.05}}},
}


@pytest.fixture
def hand(tmp_path):
    (tmp_path / "hand.xml").write_text(MODEL)
    return load_hand(tmp_path / "hand.xml", HandConfig.model_validate(CONFIG))


def grasped(hand):
    """Return a gripper's grasp of the bottle's cap, and the simulator."""
    simulator = Simulator(hand, "bottle")
    top = float(simulator.object.vertices[:, 2].max())
    turn = Rotation.from_euler("xyz", [180.0, 0.0, 25.0], degrees=True).as_matrix()
    center = np.array([0.0, 0.0, top - 0.01])
    pose = Pose.from_matrix(np.column_stack([turn, center - turn @ hand.grasp_center]))
    return simulator, simulator.grasp(pose)


@pytest.mark.parametrize("name", ["palm", "wrist", "world", "/World/gripper/wrist"])
def test_a_file_places_the_body_that_it_names(hand, name):
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qpos[0] = np.radians(10.0)  # where the tilt rests: at the end of its range next to 0
    mujoco.mj_kinematics(model, data)
    body = model.body(name.rpartition("/")[2]).id
    rotation, place = Rotation.from_rotvec([0.4, -0.2, 1.0]).as_matrix(), np.array([0.1, -0.3, 0.2])
    quaternion = tuple(Rotation.from_matrix(rotation).as_quat(scalar_first=True).tolist())
    grasp = StoredGrasp("first", 1.0, tuple(place.tolist()), quaternion)
    found = palm_pose(hand, GraspFile("cube", name, (grasp,)), grasp)
    # The palm frame by its description, in MuJoCo's frame of the palm's body, whose axes it has turned about z.
    palm = model.body("palm").id
    inside = data.xmat[palm].reshape(3, 3) @ np.array([0.0, 0.01, 0.002]) + data.xpos[palm]
    seen = data.xmat[body].reshape(3, 3).T @ (inside - data.xpos[body])
    np.testing.assert_allclose(found.position, rotation @ seen + place, atol=1e-12)
    along = data.xmat[body].reshape(3, 3).T @ data.xmat[palm].reshape(3, 3) @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(found.rotation[:, 2], rotation @ along, atol=1e-12)
    assert unknown_frame(hand, GraspFile("cube", name, (grasp,))) == ""


def test_a_frame_that_the_hand_does_not_have_is_said(hand):
    grasp = StoredGrasp("first", 1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    file = GraspFile("cube", "/World/panda/panda_hand", (grasp,))
    assert "'panda_hand' is none of hand gripper; it is taken for 'palm'" in unknown_frame(hand, file)
    assert palm_pose(hand, file, grasp) == palm_pose(hand, replace(file, gripper_frame="palm"), grasp)
    assert "taken for 'icub-left palm'" in unknown_frame(icub_left_hand(), file)
    assert unknown_frame(hand, GraspFile("cube", "", (grasp,))) == ""
    with pytest.raises(InputError, match="'l', which a finger of hand 'gripper' moves"):
        palm_pose(hand, GraspFile("cube", "l", (grasp,)), grasp)


def test_frames_and_joints_are_those_of_the_model(hand, tmp_path):
    simulator, grasp = grasped(hand)
    preshape = hand.preshapes["pinch"]
    stored = stored_grasp(hand, grasp, preshape, "g", 2.0)
    assert (stored.confidence, stored.quality) == (1.0, grasp.quality)
    write_grasps(tmp_path, [stored], simulator.object, hand, preshape, ["isaac", "dexgraspbench", "graspgen"])
    # MuJoCo puts the model's root where the file says and moves its joints in its own order
    row = np.load(tmp_path / "dexgraspbench" / "grasps" / "g.npy", allow_pickle=True).item()
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qpos[:] = row["grasp_qpos"][7:]
    mujoco.mj_kinematics(model, data)
    root = Pose(tuple(row["grasp_qpos"][:3]), tuple(row["grasp_qpos"][3:7]))
    placed = {name: root.apply(data.body(name).xpos) for name in ("palm", "l", "r")}
    file = read_grasps(tmp_path / "grasps.yaml")
    assert (file.gripper_frame, file.open_limit, file.finger_colliders) == ("palm", "lower", ("l", "r"))
    np.testing.assert_allclose(file.grasps[0].position, placed["palm"], atol=1e-12)
    turned = root.rotation @ data.body("palm").xmat.reshape(3, 3)
    np.testing.assert_allclose(file.grasps[0].pose.rotation, turned, atol=1e-12)
    # the fingers in the simulator are where MuJoCo has them
    frames = moved_frames(grasp.pose.matrix, simulator.arrays.bases)
    for f, name in enumerate(("l", "r")):
        along = frames[f, :, 2] * grasp.joints[f, 0]
        np.testing.assert_allclose(frames[f, :, 3] + along, placed[name], atol=1e-12)
    assert row["joint_names"] == ["tilt", "right", "left"]
    assert row["grasp_qpos"][7] == pytest.approx(np.radians(10.0)), "at the end of its range, where the hand has it"
    gen = read_grasps(tmp_path / "graspgen.json")
    for kind in (file, gen, read_grasps(tmp_path / "dexgraspbench" / "grasps")):
        assert palm_pose(hand, kind, kind.grasps[0]).matrix == pytest.approx(grasp.pose.matrix, abs=1e-9)


def test_the_object_is_written_in_meters_and_in_convex_pieces(hand, tmp_path):
    simulator, grasp = grasped(hand)
    preshape, obj = hand.preshapes["pinch"], simulator.object
    stored = stored_grasp(hand, grasp, preshape, "g", 1.0)
    write_grasps(tmp_path, [stored], obj, hand, preshape, ["dexgraspbench"])
    assert trimesh.load(tmp_path / "bottle.obj").bounds == pytest.approx(
        np.array([obj.vertices.min(0), obj.vertices.max(0)])
    )
    folder = tmp_path / "dexgraspbench" / "bottle"
    about = json.loads((folder / "info" / "simplified.json").read_text())
    pieces = [trimesh.load(file) for file in sorted((folder / "urdf" / "meshes").glob("convex_piece_*.obj"))]
    assert all(piece.is_watertight and piece.volume > 0.0 for piece in pieces)
    volume = sum(piece.volume for piece in pieces)
    assert volume == pytest.approx(trimesh.Trimesh(obj.vertices, obj.faces).volume, rel=0.05)
    assert about["mass"] / about["density"] == pytest.approx(volume, rel=1e-6), "what the benchmark takes the mass from"


def test_every_format_is_rated_as_the_run_rated_it(hand, tmp_path):
    simulator, grasp = grasped(hand)
    preshape = hand.preshapes["pinch"]
    write_grasps(
        tmp_path, [stored_grasp(hand, grasp, preshape, "g", 1.0)], simulator.object, hand, preshape, ["graspgen"]
    )
    for name in ("grasps.yaml", "graspgen.json"):
        (rated,) = rated_grasps(simulator, read_grasps(tmp_path / name), lambda other: pytest.fail(str(other)), 5)
        assert rated.grasp.status == grasp.status
        assert rated.grasp.quality == pytest.approx(grasp.quality, rel=1e-6)
        assert rated.robust.values.shape == (5,)


def test_a_foreign_grasp_closes_from_open_to_closed_and_on_until_it_touches():
    hand = icub_left_hand()
    simulator = Simulator(hand, "mug")
    grasp = simulator.grasp(Pose((0.0487, 0.0935, 0.0612), (0.5, 0.5, -0.5, -0.5)), -0.95)
    own = stored_grasp(hand, grasp, hand.preshapes["power"], "g", 1.0)
    loose = {name: 0.9 * value for name, value in own.joints.items()}
    foreign = replace(own, quality=None, joints=loose)
    motion = closing_hand(hand, own.pregrasp_joints, loose).preshapes["file"]
    for name, start, rate in zip(hand.joint_names, motion.start.ravel(), motion.rate.ravel(), strict=True):
        np.testing.assert_allclose(rate * 2.0 * np.pi, 1.5 * (loose[name] - start), atol=1e-12)

    def build(other):
        return Simulator(other, simulator.object)

    file = GraspFile("mug", "icub-left palm", (foreign,))
    (rated,) = rated_grasps(simulator, file, build)
    assert rated.grasp.status == grasp.status == "ok"
    assert rated.grasp.quality == pytest.approx(grasp.quality, rel=0.3), "the same fingers touch about the same places"
    with pytest.raises(InputError, match="grasp 'g': the file's joints thumb are none of hand 'icub-left'"):
        list(rated_grasps(simulator, replace(file, grasps=(replace(foreign, joints={"thumb": 1.0}),)), build))
    with pytest.raises(InputError, match="open and closed are the same"):
        closing_hand(hand, own.pregrasp_joints, own.pregrasp_joints)
    from_open = closing_hand(hand, {}, loose).preshapes["file"]
    np.testing.assert_array_equal(from_open.start, np.clip(hand.preshapes["power"].start, hand.lower, hand.upper))


def test_a_built_in_hand_is_its_own_model():
    hand = icub_left_hand()
    file = described_gripper(hand, hand.preshapes["power"], GraspFile("o", "", ()))
    assert (file.gripper_frame, file.gripper_file, joint_order(hand)) == ("icub-left palm", "", hand.joint_names)
    assert file.finger_colliders == tuple(f"{finger} distal" for finger in hand.finger_names)
    assert in_root_frame(hand, file).grasps == ()
