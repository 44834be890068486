"""What is proposed for hands that nobody has described: palm, fingers, closing directions and frames."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.inspection import finger_motions, hand_faults
from surehold.grasping.hand.proposal import propose_hand
from tests.grasping.hand_models import SLIDING, TURNING, five_fingers, linkage, mimicking_linkage, three_fingers


@pytest.fixture
def propose(tmp_path):
    def proposed(text, suffix=".xml", palm=""):
        path = tmp_path / f"hand{suffix}"
        path.write_text(text)
        return propose_hand(path, palm)

    return proposed


def closed_of(proposal):
    return next(iter(proposal.config.preshapes.values())).closed


def opened_of(proposal):
    return next(iter(proposal.config.preshapes.values())).open


@pytest.mark.parametrize("words", [True, False])
def test_a_hand_of_five_fingers(propose, words):
    found = propose(five_fingers(words=words))
    assert not found.gripper
    assert found.opposed == "thumb"
    names = ["index", "middle", "ring", "little"] if words else [f"finger_{k}" for k in (1, 2, 3, 4)]
    assert list(found.config.fingers) == [*names, "thumb"]
    assert found.config.palm.body == "palm"
    assert found.config.palm.x == [1.0, 0.0, 0.0]
    assert found.config.palm.z == [0.0, 0.0, 1.0]
    first = "index" if words else "a"
    assert found.config.fingers[names[0]] == [f"{first}_spread", *(f"{first}_bend_{k}" for k in (1, 2, 3))]
    roles = [found.roles[joint] for joint in found.config.fingers[names[0]]]
    assert roles == ["spreads", "bends", "bends", "bends"]
    assert [found.roles[joint] for joint in found.config.fingers["thumb"]] == ["opposes", "bends", "bends"]
    assert set(closed_of(found)) == {joint for joint, role in found.roles.items() if role == "bends"}
    assert all(value == pytest.approx(np.pi / 2.0, abs=1e-4) for value in closed_of(found).values())
    assert list(opened_of(found)) == [found.config.fingers["thumb"][0]], "the thumb is swung before the fingers"
    assert next(iter(opened_of(found).values())) > 0.7


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_frame_turns_with_the_hand(propose, mirrored):
    straight = propose(five_fingers(mirrored=mirrored))
    for turn in Rotation.from_rotvec([[0.6, 0.7, -0.4], [-1.9, 0.8, 0.6], [0.5, -0.6, 2.4]]).as_matrix():
        turned = propose(five_fingers(turn, mirrored))
        np.testing.assert_allclose(turned.config.palm.x, turn[:, 0], atol=0.03)
        np.testing.assert_allclose(turned.config.palm.z, turn[:, 2], atol=0.03)
        np.testing.assert_allclose(turned.config.palm.grasp_center, straight.config.palm.grasp_center, atol=2e-3)
        assert closed_of(turned) == pytest.approx(closed_of(straight))
        assert opened_of(turned) == pytest.approx(opened_of(straight), abs=0.02)


def test_axes_near_those_of_the_body_are_those(propose):
    slight = Rotation.from_rotvec([0.05, -0.04, 0.06]).as_matrix()
    found = propose(five_fingers(slight))
    assert found.config.palm.x == [1.0, 0.0, 0.0]
    assert found.config.palm.z == [0.0, 0.0, 1.0]


def test_an_object_belongs_before_the_palm_between_fingers_and_thumb(propose):
    center = np.array(propose(five_fingers()).config.palm.grasp_center)
    assert 0.03 < center[0] < 0.12
    assert abs(center[1]) < 0.03
    assert 0.015 < center[2] < 0.06


def test_fingers_that_slide(propose):
    found = propose(SLIDING)
    assert found.gripper
    assert list(found.config.fingers) == ["left", "right"]
    assert np.abs(found.config.palm.x).tolist() == [1.0, 0.0, 0.0]
    assert found.config.palm.z == [0.0, 0.0, 1.0]
    assert opened_of(found) == {"left_slide": 0.04, "right_slide": 0.04}, "it rests where it is closed"
    assert closed_of(found) == {"left_slide": 0.0, "right_slide": 0.0}
    assert set(found.roles.values()) == {"slides"}


def test_a_finger_that_mimics_the_other(propose):
    found = propose(TURNING, ".urdf")
    assert found.gripper
    assert found.roles == {"a": "bends", "b": "follows a"}
    assert opened_of(found) == {"a": pytest.approx(-0.2)}
    assert closed_of(found) == {"a": pytest.approx(1.2)}
    assert found.config.palm.z == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("spread", [120.0, 150.0, 180.0])
def test_three_fingers_around_a_plate(propose, spread):
    found = propose(three_fingers(spread if spread < 180.0 else 179.0))
    assert found.gripper
    assert found.config.palm.z == [0.0, 0.0, 1.0]
    assert all(value > 1.5 for value in closed_of(found).values())
    assert set(opened_of(found)) == {"near0", "near1", "near2"}, "it opens wider than at rest"
    assert all(value == pytest.approx(-np.pi / 6.0, abs=1e-4) for value in opened_of(found).values())
    if spread > 130.0:
        assert found.opposed == "finger_1"
        assert found.config.palm.x == [1.0, 0.0, 0.0], "from the single finger to the two others"


@pytest.mark.parametrize("model", [linkage(), mimicking_linkage()])
def test_bars_of_a_linkage_are_no_fingers(propose, model):
    """Where all joints follow a bar, as in models of the Robotiq 2F-85, none was found that leads: a traceback."""
    found = propose(model)
    assert list(found.config.fingers.values()) == [["inner_l", "pad_l"], ["inner_r", "pad_r"]]
    assert closed_of(found) == {"drive_l": 0.5}, "the bar that an actuator drives"
    assert found.roles["pad_r"] == "follows drive_l"
    assert found.config.palm.z == [0.0, 0.0, 1.0]


def test_joints_that_carry_several_fingers_rest(propose):
    model = five_fingers()
    start, end = model.index('<body name="ring_0"'), model.index('<body name="thumb_0"')
    carried = model[start:end]
    arch = '<body name="arch"><joint name="arch" axis="1 0 0" range="0 40"/><geom size=".01" pos=".06 -.02 0"/>'
    found = propose(f"{model[:start]}{arch}{carried}</body>{model[end:]}")
    assert found.resting == ("arch",)
    assert found.config.fingers["ring"][0] == "ring_spread"
    assert found.config.palm.body == "palm"


def test_a_hand_at_the_end_of_an_arm(propose):
    arm = """<body name="upper"><joint name="shoulder" axis="0 0 1" range="-90 90"/>
      <geom type="capsule" fromto="-.6 0 0 -.3 0 0" size=".03"/><body name="lower"><joint name="elbow" axis="0 0 1"
      range="-90 90"/><geom type="capsule" fromto="-.3 0 0 -.05 0 0" size=".03"/>"""
    found = propose(five_fingers(before=arm, after="</body></body>"))
    assert found.config.palm.body == "palm"
    assert "elbow" not in found.roles
    assert found.resting == ()


def test_one_of_two_hands_by_its_body(propose):
    model = five_fingers()
    other = model[model.index("<body ") : model.index("</worldbody>")]
    for name in ("palm", "index", "middle", "ring", "little", "thumb"):
        other = other.replace(f'"{name}', f'"other_{name}')
    both = model.replace("</worldbody>", f'<body name="far" pos="0 1 0">{other}</body></worldbody>')
    found = propose(both, palm="far")
    assert found.config.palm.body == "other_palm"
    assert found.config.fingers["index"][0] == "other_index_spread"
    with pytest.raises(InputError, match="38 joints in 10 chains move below"):
        propose(both)
    with pytest.raises(InputError, match="body 'fat' is unknown; did you mean 'far'"):
        propose(both, palm="fat")


@pytest.mark.parametrize(
    ("model", "suffix"),
    [
        (five_fingers(), ".xml"),
        (five_fingers(palm=""), ".xml"),
        (five_fingers(mirrored=True, words=False), ".xml"),
        (three_fingers(), ".xml"),
        (SLIDING, ".xml"),
        (TURNING, ".urdf"),
        (linkage(), ".xml"),
        (mimicking_linkage(), ".xml"),
    ],
)
def test_what_is_proposed_loads_and_closes(propose, tmp_path, model, suffix):
    hand = load_hand(tmp_path / f"hand{suffix}", propose(model, suffix).config)
    assert hand_faults(hand) == []
    motions = finger_motions(hand)
    assert all(motion.moves > 0.01 for motion in motions)
    way = np.stack([motion.way for motion in motions])
    apart = np.linalg.norm(way - way.mean(axis=0), axis=2).mean(axis=0)
    assert apart.min() < 0.75 * apart[0], "the tips come nearer to each other"


def test_tips_are_where_mujoco_has_them(propose, tmp_path):
    hand = load_hand(tmp_path / "hand.xml", propose(five_fingers()).config)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    data = mujoco.MjData(model)
    for joint, value in closed_of(propose(five_fingers())).items():
        data.joint(joint).qpos[:] = value
    data.joint("thumb_swing").qpos[:] = next(iter(opened_of(propose(five_fingers())).values()))
    mujoco.mj_kinematics(model, data)
    for motion in finger_motions(hand):
        last = data.geom(int(model.body(f"{motion.finger}_{2 if motion.finger == 'thumb' else 3}").geomadr[0]))
        half = model.geom_size[last.id][1]
        ends = [last.xpos + sign * half * last.xmat.reshape(3, 3)[:, 2] for sign in (-1.0, 1.0)]
        assert min(np.linalg.norm(motion.way[-1] - end) for end in ends) < 1e-6


BAR = (
    '<body name="b{k}" pos="{x} 0 0"><joint name="j{k}" axis="0 1 0" range="0 {most}"/><geom size=".02" pos="0 0 .1"/>'
)


def bars(count, most=90, depth=1):
    parts = ""
    for k in range(count):
        chain = "".join(BAR.format(k=f"{k}_{n}", x=0.1 * k if n == 0 else 0.0, most=most) for n in range(depth))
        parts += chain + "</body>" * depth
    return f'<mujoco><worldbody><body name="palm"><geom size=".02"/>{parts}</body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (
            "<mujoco><worldbody><body><geom size='.1'/></body></worldbody></mujoco>",
            ("no joint moves", "without fingers"),
        ),
        (bars(1), ("1 finger found", "two are needed")),
        (bars(2).replace("size=", "contype='0' conaffinity='0' size="), ("no fingers found", "can touch")),
        (bars(8, depth=5), ("40 joints in 8 chains", "up to 32", "--palm")),
        (bars(2, depth=9), ("up to 9 in one", "fingers of 8")),
        (bars(9), ("9 joints in 9 chains", "32 in 8 fingers")),
        (bars(301), ("301 joints move", "--palm BODY")),
        (bars(2, most=1.57), ("1.6 degrees at most", "radian")),
        ("<mujoco><worldbody>", ("not a model that MuJoCo can read",)),
        ("solid teapot", ("not a model that MuJoCo can read",)),
    ],
)
def test_models_that_are_no_hands(propose, model, words):
    with pytest.raises(InputError) as error:
        propose(model)
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_names_that_are_no_text(tmp_path):
    (tmp_path / "hand.xml").write_bytes(bars(2).encode().replace(b"j0_0", b"j\xff"))
    with pytest.raises(InputError, match="save it as UTF-8"):
        propose_hand(tmp_path / "hand.xml")
