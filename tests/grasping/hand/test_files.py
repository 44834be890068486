"""Hands of one's own: kinematics beside MuJoCo's, what is refused and why, and the two hands that packages bring."""

import copy
import importlib.util
import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from surehold.errors import InputError
from surehold.grasping import GraspChecker, Simulator, default_pose, hand_named
from surehold.grasping.hand.configuration import HandConfig, read_hand_config
from surehold.grasping.hand.cover import cover_box, cover_mesh
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.proposal import propose_hand
from surehold.grasping.hand.synergy import closing_motion

MODEL = """
<mujoco>
  <worldbody><body name="palm" pos="0.1 0.2 0.3" euler="10 20 30">
    <geom type="box" size=".02 .04 .01" pos="0 0 -.01"/>
    <body name="a" pos="-.03 0 0" euler="5 0 10">
      <joint name="a1" axis="0 1 0" range="-20 90"/>
      <geom name="a" type="capsule" fromto="0 0 .01 0 0 .04" size=".008"/>
      <body name="b" pos="0 0 .05" euler="0 0 20">
        <joint name="b1" axis="0 1 0" range="0 90"/><geom name="b" type="capsule" fromto="0 0 .01 0 0 .03" size=".007"/>
      </body>
    </body>
    <body name="c" pos=".03 0 0">
      <joint name="c1" type="slide" axis="-1 0 0" range="0 .03"/>
      <geom name="c" type="capsule" fromto="0 0 .02 0 0 .06" size=".008"/>
    </body>
    <body name="d"><joint name="d1" type="ball"/><geom size=".01"/></body>
  </body></worldbody>
</mujoco>
"""
URDF = """
<robot name="gripper">
  <link name="palm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size=".04 .08 .02"/></geometry></collision></link>
  <link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 .03"/><geometry><cylinder radius=".008" length=".06"/></geometry></collision></link>
  <link name="r"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 .03"/><geometry><box size=".016 .03 .06"/></geometry></collision></link>
  <joint name="a1" type="revolute"><parent link="palm"/><child link="l"/><origin xyz="-.04 0 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="c1" type="revolute"><parent link="palm"/><child link="r"/><origin xyz=".04 0 0"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
</robot>
"""
CONFIG = {
    "name": "two",
    "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
    "fingers": {"left": ["a1", "b1"], "right": ["c1"]},
    "coupling": {"b1": {"follows": "a1", "factor": 0.5}},
    "preshapes": {"close": {"closed": {"a1": 1.2, "c1": 0.03}}},
}


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "hand.xml"
    path.write_text(MODEL)
    return path


def described(tmp_path, **changes):
    content = copy.deepcopy(CONFIG)
    for place, value in changes.items():
        *path, last = place.split("__")
        entry = content
        for key in path:
            entry = entry[key]
        if value is None:
            del entry[last]
        else:
            entry[last] = value
    path = tmp_path / "hand.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def refused(model, config, *words):
    with pytest.raises(InputError) as error:
        load_hand(model, config)
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_links_are_where_mujoco_has_them(tmp_path, model):
    hand = load_hand(model, described(tmp_path, palm__origin=[0.01, 0.0, 0.02], palm__x=[0, 1, 0]))
    truth = mujoco.MjModel.from_xml_path(str(model))
    data = mujoco.MjData(truth)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(hand.lower, hand.upper)
        for name, value in zip(hand.joint_names, q.ravel(), strict=True):
            if name:
                data.joint(name).qpos[:] = value
        mujoco.mj_kinematics(truth, data)
        palm = data.body("palm").xmat.reshape(3, 3)
        origin = data.body("palm").xpos + palm @ [0.01, 0.0, 0.02]
        turn = palm @ np.column_stack([(0, 1, 0), (-1, 0, 0), (0, 0, 1)])
        ends = link_ends(hand.bases, hand.chains, q)
        for name, half in (("a", 0.015), ("b", 0.01), ("c", 0.02)):
            place, axis = data.geom(name).xpos, data.geom(name).xmat.reshape(3, 3)[:, 2]
            expected = np.stack([turn.T @ (place + s * half * axis - origin) for s in (-1.0, 1.0)])
            found = ends[hand.link_names.index(name)]
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_coupling_and_ranges_of_the_motion(tmp_path, model):
    hand = load_hand(model, described(tmp_path))
    closed = closing_motion(hand, 0.0).joints(2.0 * np.pi)
    angles = dict(zip(hand.joint_names, closed.ravel(), strict=True))
    assert angles["a1"] == pytest.approx(1.2)
    assert angles["b1"] == pytest.approx(0.6)
    assert angles["c1"] == pytest.approx(0.03)


def test_the_posture_variable_moves_what_it_names(tmp_path, model):
    posture = {"range": [-1.0, 1.0], "joints": {"a1": 0.2}}
    hand = load_hand(model, described(tmp_path, preshapes__close__posture=posture))
    rest, moved = (closing_motion(hand, s).joints(0.0) for s in (0.0, 1.0))
    assert (moved - rest).ravel()[hand.joint_names.index("a1")] == pytest.approx(0.2)
    assert (moved - rest).ravel()[hand.joint_names.index("b1")] == pytest.approx(0.1), "it follows"
    assert hand.preshapes["close"].s1_range == (-1.0, 1.0)


def test_urdf_and_its_boxes(tmp_path):
    path = tmp_path / "gripper.urdf"
    path.write_text(URDF)
    hand = load_hand(path, described(tmp_path, fingers__left=["a1"], coupling={}))
    assert hand.finger_names == ("left", "right")
    assert np.sum(hand.radii[1] > 0.0) == 3, "a box 30 mm wide and 16 mm thick: three capsules side by side"
    grasp = Simulator(hand, "bottle").grasp(
        default_pose(hand, Simulator(hand, "bottle").object, "right-front", 0.02, (0.0,) * 6)
    )
    assert np.isfinite(grasp.quality)


def test_only_contact_links_touch(tmp_path, model):
    hand = load_hand(model, described(tmp_path, contact_links=["b", "c"]))
    assert set(np.array(hand.link_names)[hand.radii.ravel() > 0.0]) == {"b", "c"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fingers__left": ["a1", "nope"]}, ("joint 'nope' is unknown", "a1, b1, c1, d1")),
        ({"fingers__right": ["a1"]}, ("joint 'a1' twice",)),
        ({"fingers__left": ["b1", "a1"]}, ("not moved by 'b1'", "from the palm to the tip")),
        ({"fingers__right": ["d1"]}, ("neither turns nor slides",)),
        ({"fingers": {}}, ("fingers",)),
        ({"palm": None}, ("'palm' is missing",)),
        ({"palm__body": "nobody"}, ("body 'nobody' is unknown", "palm, a, b, c, d")),
        ({"palm__x": [0, 0, 2]}, ("two directions",)),
        ({"palm__z": [0, 0, 0]}, ("two directions",)),
        ({"palm__x": [0, 0, 0]}, ("two directions",)),
        ({"palm__z": [0, 0, float("nan")]}, ("palm.z.2", "finite")),
        ({"palm__z": [0, 1]}, ("palm.z",)),
        ({"palm__grasp_center": [0, 0, 50.0]}, ("grasp_center", "in meters")),
        ({"wings": 3}, ("wings",)),
        ({"preshapes": {}}, ("preshapes",)),
        ({"preshapes__close__closed": {"zz": 1.0}}, ("close.closed 'zz'", "a1, b1, c1")),
        ({"preshapes__close__open": {"zz": 1.0}}, ("close.open 'zz'",)),
        ({"preshapes__close__closed": {"a1": 90.0}}, ("close.closed.a1 is 90", "-0.3491 to 1.571")),
        ({"preshapes__close__closed": {"a1": float("inf")}}, ("finite",)),
        ({"preshapes__close__closed": {"a1": 0.0}}, ("does not close",)),
        ({"preshapes__close__closed": {"a1": 1.0, "b1": 0.2}}, ("'b1' follows 'a1'", "take it out of close.closed")),
        ({"preshapes__close__posture": {"range": [1, -1], "joints": {"a1": 1}}}, ("the smaller one first",)),
        ({"preshapes__close__posture": {"range": [-1, 1], "joints": {"zz": 1}}}, ("close.posture 'zz'",)),
        ({"coupling": {"zz": {"follows": "a1"}}}, ("joint of coupling 'zz'",)),
        ({"coupling": {"b1": {"follows": "b1"}}}, ("follows itself",)),
        ({"contact_links": ["zz"]}, ("body 'zz' is unknown",)),
        ({"contact_links": []}, ("no geometry that can touch",)),
    ],
)
def test_a_description_that_does_not_fit(tmp_path, model, changes, words):
    refused(model, described(tmp_path, **changes), *words)


@pytest.mark.parametrize(
    "text",
    ["", "- 1", "a: &a [1]\nb: *a", "name: a\nname: b", "!!python/object/apply:os.system ['touch owned']", "\x00"],
)
def test_a_description_is_plain_data(tmp_path, model, text, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hand.yaml").write_text(text)
    refused(model, tmp_path / "hand.yaml", "hand.yaml")
    assert not (tmp_path / "owned").exists()


def test_models_that_are_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = described(tmp_path)
    cases = {
        "empty.xml": ("", "not a model that MuJoCo can read"),
        "open.xml": ("<mujoco><worldbody>", "not a model that MuJoCo can read"),
        "noise.xml": ("\x01\x02" * 500, "not a model that MuJoCo can read"),
        "still.xml": ("<mujoco/>", "has no joint"),
        "bad.urdf": ("<robot name='a'><link name='x'/><joint/></robot>", "not a model that MuJoCo can read"),
        "plugin.xml": (MODEL.replace("<worldbody>", "<extension><plugin plugin='a.b'/></extension><worldbody>"), "a.b"),
        "outside.xml": ("<mujoco><include file='/etc/passwd'/></mujoco>", "not a model that MuJoCo can read"),
        "web.xml": (
            MODEL.replace("<worldbody>", "<asset><mesh name='q' file='http://localhost/q.stl'/></asset><worldbody>"),
            "q.stl",
        ),
        "far.xml": (MODEL.replace('pos="0 0 .05"', 'pos="0 0 500"'), "takes lengths as meters"),
        "endless.xml": (MODEL.replace('pos="0 0 .05"', 'pos="0 0 1e300"'), "parts 1e+300 m apart"),
        "nan.xml": (MODEL.replace('pos="0 0 .05"', 'pos="0 0 nan"'), "not finite"),
    }
    for name, (text, reason) in cases.items():
        (tmp_path / name).write_text(text)
        refused(tmp_path / name, config, reason)
    refused(tmp_path / "nowhere.xml", config, "cannot read")
    refused(tmp_path / "hand.yaml", config, "is no model of a hand")
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_capsules_cover_what_they_replace():
    rng = np.random.default_rng(0)
    center, half = np.array([0.01, 0.02, 0.03]), np.array([0.02, 0.008, 0.03])

    def deepest(points, capsules):
        gaps = []
        for near, far, radius in capsules:
            share = np.clip((points - near) @ (far - near) / ((far - near) @ (far - near)), 0.0, 1.0)
            gaps.append(np.linalg.norm(points - near - share[:, None] * (far - near), axis=1) - radius)
        return np.min(gaps, axis=0)

    faces = center + half * rng.uniform(-1.0, 1.0, (2000, 3)) * [0.6, 1.0, 0.7]
    faces[:, 1] = center[1] + half[1]
    capsules = cover_box(center, half)
    assert deepest(faces, capsules).max() <= 0.14 * half[1]
    outside = [np.abs(0.5 * (a + b) - center) + 0.5 * np.abs(b - a) + r for a, b, r in capsules]
    assert np.all(np.max(outside, axis=0) <= half + 1e-9), "no capsule stands out of the box"
    corners = np.array([[x, y, z] for x in (0, 0.01) for y in (0, 0.012) for z in (0, 0.05)], dtype=float)
    hull = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]])
    hull = np.vstack([hull, [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]])
    assert len({float(a[2]) for a, _, _ in cover_mesh(corners, hull)}) == 3, "50 mm in three pieces"


PACKAGES = {"shadow": "gymnasium_robotics", "panda": "robosuite"}


@pytest.mark.parametrize("name", PACKAGES)
def test_hands_that_packages_bring(name):
    if importlib.util.find_spec(PACKAGES[name]) is None:
        with pytest.raises(InputError, match=r"pip install --no-deps .*nothing is downloaded otherwise"):
            hand_named(name)
        return
    hand = hand_named(name)
    simulator = Simulator(hand, "bottle")
    center = default_pose(hand, simulator.object, "right-front", 0.0, (0.0,) * 6).apply(np.asarray(hand.grasp_center))
    np.testing.assert_allclose(center, simulator.object.box_center, atol=1e-9)
    opened, closed = (closing_motion(hand, 0.0).joints(t) for t in (0.0, 2.0 * np.pi))
    tips = [link_ends(hand.bases, hand.chains, np.ascontiguousarray(q))[:, 1] for q in (opened, closed)]
    present = hand.radii.ravel() > 0.0
    along = np.ptp(tips[0][present], axis=0) - np.ptp(tips[1][present], axis=0)
    assert along[0] > 0.01, "the fingers close along x"
    grasps = [
        simulator.grasp(default_pose(hand, simulator.object, "right-front", s, (dx, dy, 0, 0, 0, 0)), s1)
        for s in (0.005, 0.013)
        for dx in np.linspace(-0.05, 0.05, 15)
        for dy in (-0.03, 0.0, 0.03)
        for s1 in (-0.8, -0.5, 0.0)
    ]
    best = max(grasps, key=lambda grasp: grasp.quality)
    assert best.quality > 0.01
    assert GraspChecker(simulator).check(best).verdict == "held"


def test_careless_inertias_do_not_refuse_a_hand(tmp_path):
    """Inertias that no body can have, or none at all, do not matter: nothing here moves by forces."""
    path = tmp_path / "gripper.urdf"
    for i, inertial in enumerate(
        (
            '<mass value="1"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-5" ixy="0" ixz="0" iyz="0"/>',
            '<mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>',
        )
    ):
        whole = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        path.write_text(URDF.replace(whole, inertial))
        described = copy.deepcopy(CONFIG) | {"fingers": {"left": ["a1"], "right": ["c1"]}, "coupling": {}}
        hand = load_hand(path, HandConfig.model_validate(described))
        assert hand.finger_names == ("left", "right"), i


def test_a_pipe_is_no_model(tmp_path):
    for name in ("hand.xml", "hand.yaml"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="is no regular file"):
        load_hand(tmp_path / "hand.xml", HandConfig.model_validate(CONFIG))
    with pytest.raises(InputError, match="is no regular file"):
        load_hand(tmp_path / "hand.xml", tmp_path / "hand.yaml")


EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "hands").glob("*.yaml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_shipped_description_closes_every_finger(path):
    """Without the models, which are their makers': each finger has a joint that closes or that the model may couple."""
    described = read_hand_config(path)
    assert described.name == path.stem
    for preshape in described.preshapes.values():
        known = {joint for joints in described.fingers.values() for joint in joints}
        assert set(preshape.open) | set(preshape.closed) <= known
        assert set(preshape.closed) - set(described.coupling) == set(preshape.closed)
    assert len(EXAMPLES) >= 7


def test_default_classes_are_resolved(tmp_path):
    """Ranges and axes of a class, geometries that are only looked at: the same hand as written out."""
    joint, geom = 'axis="0 1 0" range="0 90"', 'type="capsule" fromto="0 0 .01 0 0 .04" size=".008"'
    body = '<body pos="{x} 0 0"><joint name="{name}" {joint}/><geom {geom}/>{more}</body>'
    model = (
        '<mujoco>{defaults}<worldbody><body name="palm" {child}><geom {box}/>{left}{right}</body></worldbody></mujoco>'
    )
    box = 'type="box" size=".02 .04 .01"'
    hands = []
    for classes in (False, True):
        looks = '<geom class="looks"/>' if classes else ""
        parts = [
            body.format(x=x, name=name, joint="" if classes else joint, geom="" if classes else geom, more=looks)
            for x, name in ((-0.03, "a1"), (0.03, "c1"))
        ]
        defaults = (
            f'<default><default class="hand"><joint {joint}/><geom {geom}/>'
            '<default class="looks"><geom contype="0" conaffinity="0"/></default></default></default>'
        )
        text = model.format(
            defaults=defaults if classes else "",
            child='childclass="hand"' if classes else "",
            box=f'class="main" {box}' if classes else box,
            left=parts[0],
            right=parts[1],
        )
        (tmp_path / "hand.xml").write_text(text)
        config = described(
            tmp_path, fingers__left=["a1"], coupling={}, preshapes__close={"closed": {"a1": 1.0, "c1": 1.0}}
        )
        hands.append(load_hand(tmp_path / "hand.xml", config))
    assert all(np.array_equal(a, b) for a, b in zip(*(hand.arrays() for hand in hands), strict=True))


def test_a_range_whose_ends_are_exchanged_is_refused(tmp_path):
    """MuJoCo takes such a joint as one without limits, and hands opened and closed beyond its end."""
    joint = '<joint name="{0}" axis="0 {1} 0" range="{2}"/><geom type="box" size=".01 .008 .03" pos="0 0 .03"/>'
    fingers = [
        f'<body pos="{x} 0 0">{joint.format(name, axis, ends)}</body>'
        for x, name, axis, ends in ((-0.04, "a", 1, "0 80"), (0.04, "b", -1, "80 0"))
    ]
    path = tmp_path / "hand.xml"
    path.write_text(f'<mujoco><worldbody><body name="palm">{"".join(fingers)}</body></worldbody></mujoco>')
    with pytest.raises(InputError, match="joint 'b' has the range 80 to 0; give the lower first"):
        propose_hand(path)
    path.write_text(path.read_text().replace("80 0", "0 80"))
    assert propose_hand(path).ranges["b"] == pytest.approx((0.0, np.radians(80.0)))
