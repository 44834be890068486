"""The check by physics: closed forms where there are some, and verdicts that anybody would give."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping import Pose, Simulator, default_pose, shipped_object
from surehold.grasping.hand.configuration import read_hand_config
from surehold.grasping.hand.files import load_hand
from surehold.grasping.physics.check import LOADS, RATED, GraspChecker, _accelerations, _motion, _verdict


@pytest.fixture(scope="module")
def bottle():
    return Simulator(obj="bottle")


@pytest.fixture(scope="module")
def checker(bottle):
    return GraspChecker(bottle)


def grasp_at(simulator, dx, standoff=0.0087, s1=-0.7):
    return simulator.grasp(
        default_pose(simulator.hand, simulator.object, "right-front", standoff, (dx, *[0.0] * 5)), s1
    )


def test_a_balanced_squeeze_holds_the_bottle_where_it_was_rated(bottle, checker):
    grasp = grasp_at(bottle, -0.032)
    assert grasp.quality > 0.1
    check = checker.check(grasp)
    assert check.verdict == "held"
    assert {load.verdict for load in check.loads} == {"held"}
    assert check.settled < 0.002
    assert check.settled_turn < RATED[1]
    assert check.settled_quality == pytest.approx(grasp.quality, rel=0.1), "the grasp that was rated"
    assert tuple(load.load for load in check.loads) == LOADS
    assert check.moved == max(load.moved for load in check.loads) < 0.005


def test_fingers_that_push_as_they_can_carry_the_bottle_off(bottle):
    """They hold it under every load, but 17 mm from where it was rated."""
    grasp = grasp_at(bottle, -0.032)
    check = GraspChecker(bottle, squeeze="full").check(grasp)
    assert check.verdict == "moved"
    assert check.settled > RATED[0]
    assert check.settled_quality != pytest.approx(grasp.quality, rel=0.01)
    assert check.settled < 0.04


def test_a_stronger_squeeze_is_none_that_moves_the_object(bottle):
    """The proportion of the torques is the same, and the motors are simulated without an explosion."""
    grasp = grasp_at(bottle, -0.032)
    for force in (20.0, 60.0):
        check = GraspChecker(bottle, finger_force=force).check(grasp)
        assert check.verdict == "held", f"{force} N"
        assert check.settled < 0.002, f"{force} N"


def test_held_says_what_the_checks_say(bottle, checker):
    grasps = [grasp_at(bottle, dx) for dx in (-0.054, -0.048, -0.040, -0.032, 0.0)]
    verdicts = [check.verdict for check in checker.checks(grasps)]
    assert {"held", "dropped"} <= set(verdicts)
    assert checker.held(grasps).tolist() == [verdict == "held" for verdict in verdicts]
    assert checker.held([]).tolist() == []


def test_the_quality_of_a_state_is_that_of_the_grasp_in_it(bottle, checker):
    for dx in (-0.045, -0.032):
        grasp = grasp_at(bottle, dx)
        assert checker._quality(checker._state(grasp), grasp) == pytest.approx(grasp.quality, rel=0.1)


def test_an_empty_hand_and_a_touch_of_fingertips_drop_it(bottle, checker):
    empty = grasp_at(bottle, 0.0, standoff=0.4)
    touch = grasp_at(bottle, -0.054)
    assert (empty.status, touch.status) == ("no contact", "not closed")
    assert len(touch.contacts) >= 2
    inside = grasp_at(bottle, 0.0)
    assert inside.status == "initial collision"
    checks = checker.checks([empty, touch, inside])
    assert [check.verdict for check in checks] == ["dropped"] * 3
    fall = 0.5 * 9.81 * 1.0**2
    free = [load for load in checks[0].loads[:6] if load.turned < 1e-6]
    assert len(free) == 5, "one falls onto the hand"
    for load in free:
        assert load.moved == pytest.approx(fall, rel=0.003), "nothing slows the fall"
    assert checks[0].settled == 0.0


def test_what_is_heavy_or_slippery_or_held_weakly_is_lost(bottle):
    grasp = grasp_at(bottle, -0.032)
    assert GraspChecker(bottle, mass=12.0).check(grasp).verdict in ("slipped", "dropped")
    assert GraspChecker(bottle, finger_force=0.05).check(grasp).verdict in ("slipped", "dropped")
    slippery = Simulator(obj="bottle", friction=0.02)
    assert GraspChecker(slippery).check(grasp_at(slippery, -0.032)).verdict in ("slipped", "dropped")


def test_fingers_that_slide_squeeze_too(tmp_path):
    model, config = tmp_path / "gripper.xml", tmp_path / "gripper.yaml"
    model.write_text("""
<mujoco><worldbody><body name="palm"><geom type="box" size=".05 .02 .01"/>
  <body name="left" pos="-.045 0 .02"><joint name="left" type="slide" axis="1 0 0" range="0 .04"/>
    <geom type="box" pos="0 0 .03" size=".005 .01 .03"/></body>
  <body name="right" pos=".045 0 .02"><joint name="right" type="slide" axis="-1 0 0" range="0 .04"/>
    <geom type="box" pos="0 0 .03" size=".005 .01 .03"/></body>
</body></worldbody></mujoco>""")
    config.write_text("""
name: gripper
palm: {body: palm, x: [1, 0, 0], z: [0, 0, 1], grasp_center: [0, 0, 0.06]}
fingers: {left: [left], right: [right]}
finger_force: 40
preshapes: {pinch: {closed: {left: 0.04, right: 0.04}}}
""")
    simulator = Simulator(load_hand(model, read_hand_config(config)), "bottle")
    grasp = simulator.grasp(default_pose(simulator.hand, simulator.object, "right-front", 0.0, (0.0,) * 6), 0.0)
    assert grasp.quality > 0.005
    strong = GraspChecker(simulator)
    assert strong.finger_force == 40.0
    check = strong.check(grasp)
    assert check.verdict == "held"
    assert check.settled < RATED[0]
    assert check.settled_turn < RATED[1], "the grasp that was rated"
    assert GraspChecker(simulator, finger_force=1.0).check(grasp).verdict == "dropped"


def test_repetition_and_threads_change_nothing(bottle, checker):
    grasps = [grasp_at(bottle, x) for x in (-0.045, -0.032)]
    once = checker.checks(grasps)
    assert once == checker.checks(grasps)
    assert once == GraspChecker(bottle, threads=2).checks(grasps)
    assert once[1] == checker.check(grasps[1]), "alone or with others"


def test_the_verdict_does_not_depend_on_where_the_world_is(bottle, checker):
    motion = Pose((0.3, -0.2, 0.5), (0.5, 0.5, -0.5, 0.5))
    there = Simulator(obj="bottle", object_pose=motion)
    pose = default_pose(bottle.hand, bottle.object, "right-front", 0.0087, (-0.032, *[0.0] * 5))
    here, moved = checker.check(bottle.grasp(pose, -0.7)), checker.check(there.grasp(motion @ pose, -0.7))
    assert moved.verdict == here.verdict
    assert (moved.settled, moved.settled_quality) == pytest.approx((here.settled, here.settled_quality), rel=0.02)


def test_the_loads_are_gravity_each_way_and_a_shake_along_each_axis():
    phases = np.array([_accelerations(phase) for phase in range(12)])
    assert LOADS[:6] == tuple(f"gravity {sign}{axis}" for axis in "xyz" for sign in "+-")
    for load, expected in zip(np.moveaxis(phases, 1, 0), np.repeat(np.eye(3), 2, axis=0), strict=False):
        np.testing.assert_array_equal(np.abs(load), np.tile(9.81 * expected, (12, 1)))
    np.testing.assert_array_equal(phases[:, 0:6:2], -phases[:, 1:6:2])
    shake = phases[:, 6] - phases[:, 0]  # it weighs along +x
    seconds, ways = np.repeat(np.arange(3), 4), np.tile([5.0, 5.0, -5.0, -5.0], 3)
    np.testing.assert_allclose(shake, np.eye(3)[seconds] * ways[:, None], atol=1e-12)


def test_motions_are_those_of_the_center_of_mass_and_of_the_turn(checker):
    """A rigid body turned about any point, by SciPy's rotations; q and -q are the same turn."""
    rng, model = np.random.default_rng(0), checker.model
    before, after = np.zeros((2, 40, 1 + model.nq + model.nv))
    first, turn = Rotation.random(40, rng=rng), Rotation.random(40, rng=rng)
    places, shifts = rng.uniform(-0.2, 0.2, (2, 40, 3))
    signs = rng.choice([-1.0, 1.0], (40, 1))
    pose = slice(model.nq - 6, model.nq + 1)
    before[:, pose] = np.hstack([places, first.as_quat(scalar_first=True)])
    after[:, pose] = np.hstack([shifts, signs * (turn * first).as_quat(scalar_first=True)])
    far, turned = _motion(model, before, after)
    center = model.body_ipos[-1]
    expected = shifts + (turn * first).apply(center) - places - first.apply(center)
    np.testing.assert_allclose(far, np.linalg.norm(expected, axis=1), atol=1e-12)
    np.testing.assert_allclose(turned, turn.magnitude(), atol=1e-7)


def test_verdicts_are_those_of_the_stated_limits():
    degree = np.pi / 180.0
    assert [_verdict(m, t) for m, t in ((0.0099, 19.9 * degree), (0.0101, 0.0), (0.0, 20.1 * degree))] == [
        "held",
        "slipped",
        "slipped",
    ]
    assert [_verdict(m, t) for m, t in ((0.0499, 3.0), (0.0501, 0.0))] == ["slipped", "dropped"]


@pytest.mark.parametrize("name", ["bottle", "drill"])
def test_the_model_weighs_what_the_object_weighs(name):
    obj = shipped_object(name)
    model = GraspChecker(Simulator(obj=name)).model
    mesh = trimesh.Trimesh(obj.vertices, obj.faces, process=False)
    mesh.density = obj.mass / mesh.volume
    assert model.body_mass[-1] == pytest.approx(obj.mass)
    np.testing.assert_allclose(model.body_ipos[-1], mesh.center_mass, atol=1e-9)
    np.testing.assert_allclose(np.sort(model.body_inertia[-1]), np.sort(mesh.principal_inertia_components), rtol=1e-6)


def test_the_fingers_of_the_model_are_those_of_the_hand(bottle, checker):
    import mujoco

    from surehold.grasping.hand.kinematics import link_ends

    grasp = grasp_at(bottle, -0.032)
    data = mujoco.MjData(checker.model)
    mujoco.mj_setState(checker.model, data, checker._state(grasp), mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_forward(checker.model, data)
    ends = link_ends(bottle.hand.bases, bottle.hand.chains, grasp.joints)
    capsules = np.flatnonzero(checker.model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)
    np.testing.assert_allclose(data.geom_xpos[capsules], ends.mean(axis=1), atol=1e-9)
    np.testing.assert_allclose(
        2.0 * checker.model.geom_size[capsules, 1], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), atol=1e-9
    )
    assert np.all(data.contact.dist > -5e-4), "the closed grasp touches and does not press"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"finger_force": 0.0}, "finger_force is 0.0"),
        ({"finger_force": float("nan")}, "finger_force is nan"),
        ({"mass": -1.0}, "mass is -1.0"),
        ({"squeeze": "hard"}, "squeeze 'hard' is unknown"),
        ({"threads": 0}, "threads are 0"),
    ],
)
def test_bad_options_are_explained(bottle, options, words):
    with pytest.raises(InputError, match=words):
        GraspChecker(bottle, **options)
