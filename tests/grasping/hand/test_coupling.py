"""Joints that follow others: what the model says is what MuJoCo does with it."""

import mujoco
import numpy as np
import pytest

from surehold.errors import InputError
from surehold.grasping import Simulator, default_pose
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.synergy import closing_motion
from tests.grasping.hand_models import linkage

HINGES = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0"/>
  <default><joint axis="0 1 0" range="-2 2" damping=".01" armature=".001"/>
    <geom type="capsule" size=".006 .015"/></default>
  <worldbody><body name="palm"><geom type="box" size=".02 .04 .01" pos="0 0 -.01"/>
    <body name="a" pos="-.03 0 0"><joint name="a1" ref=".2"/><geom pos="0 0 .02"/>
      <body name="b" pos="0 0 .04"><joint name="b1" ref=".1"/><geom pos="0 0 .02"/>
        <body name="c" pos="0 0 .04"><joint name="c1"/><geom pos="0 0 .02"/></body></body></body>
    <body name="d" pos=".03 0 0"><joint name="d1" axis="0 -1 0"/><geom pos="0 0 .02"/></body>
  </body></worldbody>
  {more}
</mujoco>
"""
FOUR_BARS = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep=".001"/>
  <default><joint axis="1 0 0" damping=".05" armature=".001"/><geom type="capsule" size=".004 .01"/></default>
  <worldbody><body name="palm"><geom type="box" size=".02 .06 .01" pos="0 0 -.01"/>
    <body name="driver" pos="0 .04 .01"><joint name="driver" range="-.1 1"/><geom fromto="0 0 0 0 .02 .035"/></body>
    <body name="spring" pos="0 .02 .015"><joint name="spring" range="-.5 1.5"/><geom fromto="0 0 0 0 .02 .035"/>
      <body name="follower" pos="0 .02 .035"><joint name="follower" range="-1.5 1.5"/>
        <geom name="pad" fromto="0 0 .01 0 0 .04"/></body></body>
    <body name="other" pos="0 -.04 .01"><joint name="other" axis="-1 0 0" range="0 1"/><geom pos="0 0 .02"/></body>
  </body></worldbody>
  <equality><connect name="loop" body1="driver" body2="follower" anchor="0 .02 .035"/></equality>
</mujoco>
"""


def hand_of(tmp_path, text, fingers, closed, opened=None, **more):
    path = tmp_path / "hand.xml"
    path.write_text(text)
    preshape = {"open": opened or {}, "closed": closed, **more.pop("preshape", {})}
    config = {
        "name": "own",
        "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
        "fingers": fingers,
        "preshapes": {"close": preshape},
        **more,
    }
    return load_hand(path, HandConfig.model_validate(config))


def angles(hand, t=2.0 * np.pi):
    q = closing_motion(hand, 0.0).joints(t).ravel()
    return {name: value for name, value in zip(hand.joint_names, q, strict=True) if name}


def settled(text, held, steps=4000):
    """Return the joint angles of the model after a while in which some joints are held where they are."""
    spec = mujoco.MjSpec.from_string(text)
    for name, value in held.items():
        equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=name, objtype=mujoco.mjtObj.mjOBJ_JOINT)
        equality.data[0] = value
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.eq_solref[:], model.eq_solimp[:, :3] = (0.004, 1.0), (0.9999, 0.9999, 0.001)
    for e in range(model.neq - len(held), model.neq):  # relative to the reference
        model.eq_data[e, 0] -= model.qpos0[model.jnt_qposadr[model.eq_obj1id[e]]]
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, steps)
    return {model.joint(j).name: float(data.qpos[j]) for j in range(model.njnt)}


FINGERS = {"left": ["a1", "b1", "c1"], "right": ["d1"]}


def test_an_equality_of_joints_is_what_mujoco_makes_of_it(tmp_path):
    """A polynomial with references, and a joint that follows one that follows."""
    text = HINGES.format(
        more='<equality><joint joint1="c1" joint2="b1" polycoef="-.1 .7"/>'
        '<joint joint1="b1" joint2="a1" polycoef=".05 .5 .2"/><joint joint1="d1" polycoef=".3"/></equality>'
    )
    hand = hand_of(tmp_path, text, FINGERS, {"a1": 1.3})
    for t, a1 in ((0.0, 0.0), (2.0 * np.pi, 1.3)):
        found, truth = angles(hand, t), settled(text, {"a1": a1})
        assert found == pytest.approx(truth, abs=2e-3)
    assert found["b1"] == pytest.approx(0.1 + 0.05 + 0.5 * 1.1 + 0.2 * 1.1**2)
    assert found["c1"] == pytest.approx(-0.1 + 0.7 * (found["b1"] - 0.1))
    assert found["d1"] == pytest.approx(0.3)


def test_what_the_description_says_goes_first(tmp_path):
    text = HINGES.format(more='<equality><joint joint1="b1" joint2="a1"/><joint joint1="c1" joint2="a1"/></equality>')
    hand = hand_of(tmp_path, text, FINGERS, {"a1": 1.0, "b1": 0.2}, coupling={"c1": {"follows": "d1", "factor": 2.0}})
    assert angles(hand)["b1"] == pytest.approx(0.2)
    assert angles(hand)["c1"] == pytest.approx(0.0), "it follows d1, which stays"


def test_an_equality_that_is_not_active_is_none(tmp_path):
    text = HINGES.format(more='<equality><joint joint1="b1" joint2="a1" active="false"/></equality>')
    assert angles(hand_of(tmp_path, text, FINGERS, {"a1": 1.0}))["b1"] == 0.0


def test_joints_of_a_pulled_tendon_share_its_travel(tmp_path):
    """Equal springs: where the tendon comes to rest the joints stand as their coefficients."""
    more = '<tendon><fixed name="t"><joint joint="b1" coef="2"/><joint joint="c1" coef="-1"/></fixed></tendon>'
    text = HINGES.format(more=more + '<actuator><motor tendon="t" ctrlrange="-9 9"/></actuator>')
    hand = hand_of(tmp_path, text, FINGERS, {"b1": 1.0, "d1": 1.0})
    assert angles(hand)["c1"] == pytest.approx(-0.5)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.jnt_stiffness[:] = 0.1
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.05
    mujoco.mj_step(model, data, 5000)
    travel = data.qpos - model.qpos_spring
    assert travel[1] == pytest.approx(1.0, rel=1e-2)
    assert travel[2] / travel[1] == pytest.approx(-0.5, rel=1e-3)
    loose = HINGES.format(more=more)
    assert angles(hand_of(tmp_path, loose, FINGERS, {"b1": 1.0, "d1": 1.0}))["c1"] == 0.0, "nothing pulls"


def test_a_mimicking_joint_of_a_urdf(tmp_path):
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="{{}}">{inertia}<collision><geometry><box size=".016 .03 .06"/></geometry></collision></link>'
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="0 0 .04"/>'
        '<axis xyz="0 1 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/>{3}</joint>'
    )
    path = tmp_path / "hand.urdf"
    path.write_text(
        '<robot name="r">'
        + "".join(link.format(name) for name in ("palm", "l", "m", "n"))
        + joint.format("a1", "palm", "l", "")
        + joint.format("b1", "l", "m", '<mimic joint="a1" multiplier="0.8" offset="0.1"/>')
        + joint.format("d1", "palm", "n", "")
        + "</robot>"
    )
    config = {
        "name": "own",
        "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
        "fingers": {"left": ["a1", "b1"], "right": ["d1"]},
        "preshapes": {"close": {"closed": {"a1": 1.0, "d1": 1.0}, "posture": {"range": [0, 1], "joints": {"a1": 0.2}}}},
    }
    hand = load_hand(path, HandConfig.model_validate(config))
    assert angles(hand, 0.0)["b1"] == pytest.approx(0.1)
    assert angles(hand)["b1"] == pytest.approx(0.9)
    assert hand.preshapes["close"].posture.ravel()[hand.joint_names.index("b1")] == pytest.approx(0.16)


def test_a_closed_loop_is_met_as_mujoco_meets_it(tmp_path):
    """A gripper's parallel bars: the driver is part of no finger, and leads."""
    fingers = {"pad": ["spring", "follower"], "other": ["other"]}
    hand = hand_of(tmp_path, FOUR_BARS, fingers, {"driver": 0.7, "other": 0.5})
    for t, driver in ((0.0, 0.0), (2.0 * np.pi, 0.7)):
        found, truth = angles(hand, t), settled(FOUR_BARS, {"driver": driver, "other": 0.0})
        for joint in ("spring", "follower"):
            assert found[joint] == pytest.approx(truth[joint], abs=5e-3)
        model = mujoco.MjModel.from_xml_string(FOUR_BARS)
        data = mujoco.MjData(model)
        for name, value in (found | {"driver": driver}).items():
            data.joint(name).qpos[:] = value
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)]).max() < 1e-6
        pad = data.geom("pad")
        ends = link_ends(hand.bases, hand.chains, closing_motion(hand, 0.0).joints(t))
        middle = ends[hand.link_names.index("follower")].mean(axis=0)
        np.testing.assert_allclose(middle, pad.xpos, atol=1e-6)
    assert abs(found["spring"]) > 0.3


@pytest.mark.parametrize("top", [0.8, 1.4, 2.0])
def test_a_loop_stays_on_its_branch(tmp_path, top):
    """In a parallelogram each bar turns as far as the one that is driven, and what it carries keeps its direction.

    Solved at once, the loop of .8 closed as a crossed one, those of 1.4 and 2 after whole turns. All bars are in line
    at .98, where crossed and parallel ones meet.
    """
    text = linkage().replace('range="0 .5"', f'range="0 {top}"').replace('range="-.9 .1"', 'range="-3 .1"')
    text, fingers = text.replace('name="base"', 'name="palm"'), {s: [f"inner_{s}", f"pad_{s}"] for s in "lr"}
    hand = hand_of(tmp_path, text, fingers, {"drive_l": top})
    for t in (0.25, 1.0):
        found = angles(hand, t * 2.0 * np.pi)
        for side in "lr":
            assert found[f"inner_{side}"] == pytest.approx(t * top, abs=1e-5)
            assert found[f"pad_{side}"] == pytest.approx(-t * top, abs=1e-5)


@pytest.mark.parametrize(
    ("fingers", "closed", "words"),
    [
        ({"pad": ["spring", "follower"]}, {"driver": 0.7, "spring": -0.5}, ("close.closed", "'loop' open by", "mm")),
        ({"pad": ["spring", "follower"]}, {"nope": 0.7}, ("close.closed 'nope'", "driver")),
    ],
)
def test_a_loop_that_cannot_be_closed(tmp_path, fingers, closed, words):
    with pytest.raises(InputError) as error:
        hand_of(tmp_path, FOUR_BARS, fingers, closed)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(("factor", "limits", "expected"), [(-1, (0, 1), (-2, 0)), (0.5, (0, 1), (0, 1))])
def test_a_follower_moves_although_its_limits_lost_their_sign(tmp_path, factor, limits, expected):
    text = HINGES.format(more=f'<equality><joint joint1="d1" joint2="c1" polycoef="0 {factor}"/></equality>')
    text = text.replace('name="c1"', 'name="c1" range="0 2"')
    text = text.replace('axis="0 -1 0"', f'axis="0 -1 0" range="{limits[0]} {limits[1]}"')
    hand = hand_of(tmp_path, text, FINGERS, {"c1": 1.6})
    d1 = hand.joint_names.index("d1")
    assert (hand.lower.ravel()[d1], hand.upper.ravel()[d1]) == pytest.approx(expected)
    assert angles(hand)["d1"] == pytest.approx(1.6 * factor)


def test_two_joints_that_follow_each_other(tmp_path):
    text = HINGES.format(more='<equality><joint joint1="b1" joint2="c1"/><joint joint1="c1" joint2="b1"/></equality>')
    hand = hand_of(tmp_path, text, FINGERS, {"b1": 1.0, "d1": 1.0})
    assert angles(hand, 0.0)["c1"] == pytest.approx(angles(hand, 0.0)["b1"] - 0.1)
    assert angles(hand)["c1"] == pytest.approx(0.9), "the one that is named leads"


def test_bodies_and_joints_without_a_name(tmp_path):
    text = HINGES.format(more="").replace('name="palm"', "").replace('name="d1"', "")
    palm = {"body": "body 1", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]}
    named = HINGES.format(more="")
    hand = hand_of(tmp_path, text, FINGERS | {"right": ["joint 3"]}, {"a1": 1.0, "joint 3": 1.0}, palm=palm)
    same = hand_of(tmp_path, named, FINGERS, {"a1": 1.0, "d1": 1.0})
    assert all(np.array_equal(a, b) for a, b in zip(hand.arrays(), same.arrays(), strict=True))
    with pytest.raises(InputError, match=r"body 'wrist' is unknown; .*body 1"):
        hand_of(tmp_path, text, FINGERS | {"right": ["joint 3"]}, {"a1": 1.0}, palm=palm | {"body": "wrist"})


JOINED = """
<mujoco><compiler angle="radian"/><worldbody><body name="palm"><freejoint/>
  <geom type="box" size=".01 .02 .01" pos="0 0 -.01"/><geom type="box" size=".01 .02 .02" pos="-.02 0 .02"/>
  <body pos="0 0 .02"><joint name="a" axis="0 1 0" range="-1.5 1.5"/><geom name="a" type="capsule" size=".004 .01"/>
    <body pos="0 0 .015"><joint name="b" axis="0 1 0" range="-2.5 2.5"/>
      <geom name="b" type="capsule" size=".004 .01" pos="0 0 .012"/></body></body>
  <body pos=".05 0 .02"><joint name="c" axis="0 1 0" range="-1.5 1.5"/><geom type="capsule" size=".004 .01"/></body>
</body></worldbody></mujoco>
"""


def test_a_link_may_overlap_the_body_that_carries_it_as_in_mujoco(tmp_path):
    """The inner link turns into a box of the palm that it does not touch at first; the outer one is stopped there."""
    fingers = {"left": ["a", "b"], "right": ["c"]}
    model = mujoco.MjModel.from_xml_string(JOINED)
    data = mujoco.MjData(model)
    data.joint("a").qpos[:] = -1.2
    mujoco.mj_forward(model, data)
    touching = {model.geom(g).name for contact in data.contact for g in contact.geom} - {""}
    data.joint("a").qpos[:], data.joint("b").qpos[:] = 0.0, -2.0
    mujoco.mj_forward(model, data)
    touching_then = {model.geom(g).name for contact in data.contact for g in contact.geom} - {""}
    assert "a" not in touching
    assert "b" in touching_then
    hand = hand_of(tmp_path, JOINED, fingers, {"b": -2.0})
    assert hand.neighbors[[0, 1]].tolist() == [[True, True], [False, False]], "links a and b, boxes of the palm"
    ends = {"inner": ({"a": -1.2}, ["body 2", "body 4"]), "outer": ({"b": -2.0}, None)}
    for name, (closed, touching) in ends.items():
        hand = hand_of(tmp_path, JOINED, fingers, closed, contact_links=touching)
        simulator = Simulator(hand, "bottle")
        away = default_pose(hand, simulator.object, "right-front", 0.3, (0.0,) * 6)
        joints = dict(zip(hand.joint_names, simulator.grasp(away).joints.ravel(), strict=True))
        if name == "inner":
            assert joints["a"] == pytest.approx(-1.2)
        else:
            assert -1.9 < joints["b"] < -0.1, "stopped by the palm"
