"""Synergies from postures: against scikit-learn, the thesis' one component, and what the hand then does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from sklearn.decomposition import PCA

from surehold.errors import InputError
from surehold.grasping import Pose, Simulator, icub_left_hand, robust_quality
from surehold.grasping.hand.learned_synergy import learn_synergy, read_synergy, with_synergy, write_synergy
from surehold.grasping.hand.postures import read_postures
from surehold.grasping.hand.synergy import closing_motion
from surehold.problems import GraspProblem

RECORDED = Path(__file__).parents[3] / "examples" / "synergies" / "icub_postures.csv"


def recorded():
    return read_postures(RECORDED)


def test_components_are_those_of_scikit_learn():
    hand, postures = icub_left_hand(), recorded()
    found = learn_synergy(postures.joints, postures.angles, hand, 4)
    expected = PCA(4).fit(postures.angles)
    np.testing.assert_allclose(found.mean, expected.mean_, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.components @ expected.components_.T), np.eye(4), atol=1e-9)
    np.testing.assert_allclose(found.explained, expected.explained_variance_ratio_, rtol=1e-9)
    np.testing.assert_allclose(found.deviations**2, expected.explained_variance_, rtol=1e-9)
    amplitudes = (postures.angles - found.mean) @ found.components.T
    np.testing.assert_array_equal(found.ranges, np.column_stack([amplitudes.min(0), amplitudes.max(0)]))


def test_one_component_is_the_closure_of_the_thesis():
    hand = icub_left_hand()
    motion = closing_motion(hand, 0.1, "power")
    free = (motion.start + motion.rate * t for t in np.linspace(3.5, 6.0, 40))  # where few joints are at their limits
    angles = np.stack([q.ravel() for q in free])
    found = learn_synergy(hand.joint_names, angles, hand, 1)
    assert found.explained == pytest.approx([1.0])
    direction = motion.rate.ravel() / np.linalg.norm(motion.rate)
    np.testing.assert_allclose(found.components[0], direction, atol=1e-12)  # closes as the power grasp closes
    learned = closing_motion(with_synergy(hand, found, "learned"), 0.0, "learned")
    opened, closed = learned.joints(0.0), learned.joints(2.0 * np.pi)
    for t in np.linspace(3.5, 6.0, 6):
        wanted = motion.joints(float(t))
        amplitude = float((motion.start + motion.rate * t).ravel() @ direction - found.mean @ direction)
        share = (amplitude - found.closing[0]) / (found.closing[1] - found.closing[0])
        np.testing.assert_allclose(learned.joints(2.0 * np.pi * share), wanted, atol=1e-9)
    assert np.all((opened <= closed + 1e-12) | (motion.rate < 0.0))


def test_open_and_closed_go_beyond_what_was_recorded_up_to_the_limits():
    hand, postures = icub_left_hand(), recorded()
    found = learn_synergy(postures.joints, postures.angles, hand, 3)
    width = float(np.ptp(found.ranges[0]))
    assert found.ranges[0, 0] - width <= found.closing[0] <= found.ranges[0, 0]
    assert found.ranges[0, 1] <= found.closing[1] <= found.ranges[0, 1] + width
    preshape = with_synergy(hand, found, "learned").preshapes["learned"]
    assert preshape.s1_useful == pytest.approx(tuple(found.ranges[1]))
    assert len(preshape.further) == 1
    np.testing.assert_allclose(preshape.further[0].ravel(), found.components[2])


def test_a_synergy_comes_back_and_a_bad_one_is_refused(tmp_path):
    hand, postures = icub_left_hand(), recorded()
    found = learn_synergy(postures.joints, postures.angles, hand, 2)
    path = tmp_path / "synergy.yaml"
    write_synergy(path, found)
    back = read_synergy(path)
    assert (back.joints, back.closing, back.hand) == (found.joints, found.closing, "icub-left")
    for name in ("mean", "components", "deviations", "explained", "ranges"):
        np.testing.assert_array_equal(getattr(back, name), getattr(found, name))
    content = yaml.safe_load(path.read_text())
    for change, words in (
        ({"format": "x"}, "is no synergy"),
        ({"format_version": 2}, "has format_version '2'; 1 is read"),
        ({"joints": ["a"]}, "components must be k x 1 numbers"),
        ({"joints": ["a"] * 20}, "each once"),
        ({"components": [[2.0] * 20]}, "rows of length 1"),
        ({"mean": ["x"]}, "mean must be 20 numbers"),
        ({"mean": [float("nan")] * 20}, "mean must be finite"),
        ({"closing": {"open": 1.0, "closed": 1.0}}, "must be below"),
        ({"closing": 3}, "closing.open and closing.closed"),
        ({"ranges": [[0.0, 1.0], [1.0, 0.0]]}, "the smaller one first"),
    ):
        path.write_text(yaml.safe_dump(content | change))
        with pytest.raises(InputError, match=words):
            read_synergy(path)


def test_a_column_that_is_no_joint_is_named(tmp_path):
    hand = icub_left_hand()
    first, second = [name for name in hand.joint_names if name][:2]
    (tmp_path / "p.csv").write_text(f"{first},{second},subject\n1,2,ann\n")
    with pytest.raises(InputError, match="column 'subject' is no joint of the hand; leave it out"):
        read_postures(tmp_path / "p.csv", hand=hand)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "first row must name"),
        ("a,a\n1,2\n", "each once"),
        ("a,b\n1\n", "row 2 has 1 entries"),
        ("a,b\n1,x\n", "row 2, b: 'x' is no finite number"),
        ("a,b\n1,nan\n", "no finite number"),
        (",".join(f"j{i}" for i in range(201)), "up to 200 joints"),
        ("a,b\n\n1,2\n\n3,x\n", "row 5, b: 'x' is no finite number"),
        ("a,b\n1,2\n\n3\n", "row 4 has 1 entries"),
    ],
)
def test_bad_recordings_are_refused(tmp_path, text, words):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_postures(tmp_path / "p.csv")


def test_recordings_of_other_shapes_are_read(tmp_path):
    (tmp_path / "p.csv").write_bytes("\ufeffb;grasp;a\r\n90;power;0\r\n180;pinch;45\r\n".encode())
    found = read_postures(tmp_path / "p.csv", degrees=True)
    assert (found.joints, found.grasps) == (("b", "a"), ("power", "pinch"))
    np.testing.assert_allclose(found.angles, [[np.pi / 2, 0], [np.pi, np.pi / 4]])


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_semicolons_leave_commas_to_the_numbers(tmp_path, end):
    (tmp_path / "p.csv").write_bytes(end.join(["a;b", "0,5;1", "-1,25;0,75"]).encode())
    np.testing.assert_array_equal(read_postures(tmp_path / "p.csv").angles, [[0.5, 1.0], [-1.25, 0.75]])


def test_radians_are_not_taken_for_degrees(tmp_path):
    (tmp_path / "p.csv").write_text("a,b\n0.1,0.2\n1.2,1.4\n")
    with pytest.raises(InputError, match=r"largest angle is 1.4, .* leave --degrees"):
        read_postures(tmp_path / "p.csv", degrees=True)


def test_degrees_are_of_joints_that_turn(tmp_path):
    """A shift of 20 mm of a recording in degrees was read as .35 mm."""
    hand = icub_left_hand()
    chains = hand.chains.copy()
    chains[0, 0, 0] = 1.0
    hand = replace(hand, chains=chains)
    slides, turns = np.array(hand.joint_names).reshape(hand.radii.shape)[0, :2]
    (tmp_path / "p.csv").write_text(f"{slides},{turns}\n0.02,90\n")
    found = read_postures(tmp_path / "p.csv", degrees=True, hand=hand)
    np.testing.assert_allclose(found.angles, [[0.02, np.pi / 2]])


def test_too_little_is_refused():
    hand = icub_left_hand()
    with pytest.raises(InputError, match=r"joint of hand 'icub-left' 'index' is unknown"):
        learn_synergy(["index"], np.eye(2)[:, :1], hand, 1)
    with pytest.raises(InputError, match="do not differ"):
        learn_synergy(hand.joint_names[:2], np.ones((5, 2)), hand, 1)
    for angles in (np.full((3, 2), np.nan), np.eye(3), np.ones(4)):
        with pytest.raises(InputError, match="give one finite number for each"):
            learn_synergy(hand.joint_names[:2], angles, hand, 1)
    with pytest.raises(InputError, match="each joint once"):
        learn_synergy(hand.joint_names[:1] * 2, np.eye(3)[:, :2], hand, 1)
    with pytest.raises(InputError, match="components are 3; 3 postures of 2 joints give 1 to 2"):
        learn_synergy(hand.joint_names[:2], np.eye(3)[:, :2], hand, 3)


def test_postures_in_degrees_are_refused_and_read_as_such():
    hand, postures = icub_left_hand(), recorded()
    degrees = np.degrees(postures.angles)
    joint, row = "thumb_knuckle", int(np.argmax(degrees[:, postures.joints.index("thumb_knuckle")]))
    upper = hand.upper.ravel()[hand.joint_names.index(joint)]
    said = (
        rf"joint '{joint}' is 115\.\d rad in posture {row}, but of hand 'icub-left' .* to {upper:.3g} rad; .* --degrees"
    )
    with pytest.raises(InputError, match=said):
        learn_synergy(postures.joints, degrees, hand)
    beyond = postures.angles.copy()
    beyond[0, postures.joints.index("index_proximal")] = -3.0  # beyond its range, as a glove may say it
    assert len(learn_synergy(postures.joints, beyond, hand).components) == 2


def test_the_hand_closes_along_the_amplitudes_that_are_asked_for(tmp_path):
    hand, postures = icub_left_hand(), recorded()
    write_synergy(tmp_path / "s.yaml", learn_synergy(postures.joints, postures.angles, hand, 3))
    found = read_synergy(tmp_path / "s.yaml")
    moved = with_synergy(hand, found, "learned")
    motion = closing_motion(moved, (0.2, -0.3), "learned")
    wanted = found.mean + found.closing[0] * found.components[0] + 0.2 * found.components[1] - 0.3 * found.components[2]
    np.testing.assert_allclose(motion.start.ravel(), wanted, atol=1e-12)
    with pytest.raises(InputError, match="3 amplitudes are given; the preshape has 2"):
        closing_motion(moved, (0.0, 0.0, 0.0), "learned")
    simulator = Simulator(moved, "bottle", preshape="learned")
    pose = Pose((-0.09, 0.0, 0.0), (0.5, 0.5, 0.5, 0.5))
    grasp = simulator.grasp(pose, (0.2, -0.3))
    assert grasp.s1 == (0.2, -0.3)
    np.testing.assert_array_equal(grasp.open_joints, motion.joints(0.0))
    assert robust_quality(simulator, pose, (0.2, -0.3), n=3).values.shape == (3,)


def test_amplitudes_are_variables_of_a_grasp():
    hand, postures = icub_left_hand(), recorded()
    moved = with_synergy(hand, learn_synergy(postures.joints, postures.angles, hand, 3), "learned")
    problem = GraspProblem(
        "bottle", "right-front", ("dx", "s1", "s2"), hand=moved, preshape="learned", contact="single"
    )
    preshape = moved.preshapes["learned"]
    assert problem.units == ("m", "rad", "rad")
    limits = np.column_stack([problem.box.lower, problem.box.upper])[1:]
    np.testing.assert_allclose(limits, [preshape.s1_useful, preshape.further_ranges[0]])
    x = problem.box.from_unit([0.5, 0.25, 0.75])
    assert problem.posture(x) == tuple(x[1:])
    assert problem.grasp(x).s1 == tuple(x[1:])
    with pytest.raises(InputError, match="has no amplitude s3"):
        GraspProblem("bottle", "right-front", ("s3",), hand=moved, preshape="learned")
    with pytest.raises(InputError, match="has no amplitude s2"):
        GraspProblem("bottle", "right-front", ("s2",))
