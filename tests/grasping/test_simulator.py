import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import surehold
from surehold.errors import InputError
from surehold.grasping import (
    OBJECTS,
    STATUSES,
    Pose,
    Simulator,
    default_pose,
    grasp_batch,
    grasp_scene,
    robust_quality,
    shipped_object,
    wrench_quality,
)
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.solids import Tube, triangles


@pytest.fixture(scope="module")
def simulator():
    return Simulator("icub-left", "mug")


def pose_of(simulator, dx=-0.057, dy=0.0, standoff=0.021, mode="right-front"):
    return default_pose(simulator.hand, simulator.object, mode, standoff, (dx, dy, 0.0, 0.0, 0.0, 0.0))


def random_pose(simulator, rng):
    mode = ("right-front", "front-left", "top-left", "back-top")[rng.integers(4)]
    half = simulator.object.box_half_extents
    offsets = rng.uniform(-1, 1, 6) * np.array([0.09, half[2], 0.02, 0.7, 0.7, 0.7])
    return default_pose(simulator.hand, simulator.object, mode, float(rng.uniform(0.01, 0.09)), offsets)


def test_each_status_and_its_quality(simulator):
    held = simulator.grasp(pose_of(simulator), -0.7)
    assert held.status == "ok"
    assert held.quality > 0.05
    assert {name.split()[0] for name in held.touching} >= {"thumb", "index", "middle", "ring"}
    inside = simulator.grasp(pose_of(simulator, dx=0.0), -0.7)
    assert (inside.status, len(inside.contacts)) == ("initial collision", 0)
    assert inside.penetration > 0.001
    assert -0.05 < inside.quality < 0.0
    away = simulator.grasp(pose_of(simulator, standoff=0.4), -0.7)
    assert (away.status, away.quality, away.penetration) == ("no contact", 0.0, 0.0)
    loose = simulator.grasp(pose_of(simulator, standoff=0.062, dx=-0.07), -0.7)
    assert loose.quality == 0.0
    assert loose.status in ("not closed", "no contact")


def test_quality_is_the_wrench_measure_of_its_contacts(simulator):
    grasp = simulator.grasp(pose_of(simulator), -0.7)
    contacts, mug = grasp.contacts, simulator.object
    expected = wrench_quality(
        contacts.points,
        contacts.normals,
        0.5,
        8,
        mug.torque_length,
        mug.center_of_mass,
        weights=contacts.weights,
        cones="round",
    )
    assert grasp.quality == expected.epsilon
    volume = Simulator(obj="bottle", quality="volume", contact="single")
    found = volume.grasp(pose_of(volume, dx=-0.02, standoff=0.012), -0.45)
    if found.status == "ok":
        assert found.wrench is not None
        assert found.quality == found.wrench.volume > 0.0


def test_moving_hand_and_object_together_changes_nothing(simulator):
    rng = np.random.default_rng(0)
    for _ in range(12):
        motion = Pose(tuple(rng.uniform(-1, 1, 3)), tuple(Rotation.random(rng=rng).as_quat(scalar_first=True)))
        there = Simulator(obj="mug", object_pose=motion)
        pose = pose_of(simulator, dx=float(rng.uniform(-0.07, -0.05)), dy=float(rng.uniform(-0.02, 0.02)))
        here, moved = simulator.grasp(pose, -0.7), there.grasp(motion @ pose, -0.7)
        assert here.quality > 0.0
        assert moved.quality == pytest.approx(here.quality, abs=1e-9)
        assert moved.status == here.status


@pytest.mark.parametrize("name", OBJECTS)
def test_random_poses_give_finite_results_and_repeat(name):
    simulator, rng = Simulator(obj=name), np.random.default_rng(1)
    seen = set()
    for _ in range(150):
        pose, s1 = random_pose(simulator, rng), float(rng.uniform(-np.pi, np.pi))
        grasp = simulator.grasp(pose, s1)
        seen.add(grasp.status)
        assert grasp.status in STATUSES
        assert np.isfinite(grasp.quality)
        assert (grasp.quality > 0.0) == (grasp.status == "ok")
        assert (grasp.quality < 0.0) == (grasp.status == "initial collision")
        assert np.all(grasp.joints >= simulator.hand.lower - 1e-12)
        assert np.all(grasp.joints <= simulator.hand.upper + 1e-12)
        assert simulator.grasp(pose, s1).quality == grasp.quality
    assert len(seen) >= 2


def test_a_collision_costs_more_the_deeper_it_is(simulator):
    worth = [simulator.grasp(pose_of(simulator, dx=x), -0.7) for x in np.arange(-0.042, -0.034, 0.001)]
    values = np.array([g.quality for g in worth if g.status == "initial collision"])
    assert len(values) >= 4
    assert np.all(np.diff(values) < 0.0)
    assert values[0] > -0.02
    plain = Simulator(obj="mug", collision="zero").grasp(pose_of(simulator, dx=0.0), -0.7)
    assert (plain.status, plain.quality) == ("initial collision", 0.0)


def test_a_collision_is_worth_what_all_bodies_are_inside_together(simulator):
    for x in (-0.038, -0.03, 0.0):
        grasp = simulator.grasp(pose_of(simulator, dx=x), -0.7)
        depths = np.maximum(-simulator.gaps(grasp.pose, grasp.open_joints), 0.0)
        assert np.sum(depths > 0.0) > 1
        assert grasp.penetration == depths.max()
        assert grasp.quality == pytest.approx(-0.05 * (1.0 - np.exp(-depths.sum() / 0.02)), rel=1e-12)


def test_the_friction_is_that_given_else_that_of_the_hand_else_that_of_the_object(simulator):
    sticky = replace(simulator.hand, friction=0.9)
    assert Simulator(simulator.hand, "drill").friction == shipped_object("drill").friction == 0.7
    assert Simulator(sticky, "drill").friction == Simulator(sticky, "drill").measure.friction == 0.9
    assert Simulator(sticky, "drill", friction=0.3).friction == 0.3


def test_one_contact_is_none_and_counts_by_the_gaps_of_the_fingers():
    options = {"obj": "mug", "contact": "single", "quality": "signed_epsilon", "depth": 0.0005}
    simulator = Simulator(**options)
    grasp = simulator.grasp(pose_of(simulator, standoff=0.072), -0.7)
    assert (grasp.status, len(grasp.contacts), grasp.touching) == ("no contact", 1, ("thumb distal",))
    gaps = simulator.gaps(grasp.pose, grasp.joints)[:-1].reshape(5, 4).min(axis=1).clip(0.0)
    away = gaps.mean() / simulator.object.torque_length
    assert grasp.quality == pytest.approx(-0.05 * np.log1p(away / 0.05), rel=1e-12)
    (alone,) = grasp_batch(simulator, [grasp.pose], -0.7).quality
    assert alone == grasp.quality
    assert len(simulator.contacts_at(grasp.pose, grasp.joints)) == 1
    assert simulator.quality_at(grasp.pose, grasp.joints) == grasp.quality
    motion = Pose((0.3, -0.2, 0.1), (0.5, 0.5, 0.5, -0.5))
    there = Simulator(**options, object_pose=motion)
    assert there.grasp(motion @ grasp.pose, -0.7).quality == pytest.approx(grasp.quality, abs=1e-9)


def test_distances_are_exact_as_far_as_thick_fingers_feel_from_their_axes(simulator):
    """Beyond the grid of the distance field there is no object, but its box."""
    solids = (Tube(((0.0, 0.0, -0.001), (0.0, 0.0, 0.001)), 0.005),)
    vertices, faces, volume, center = triangles(solids)
    pill = GraspObject("pill", vertices, faces, 1000.0 * volume, center, solids=solids)
    thick = replace(simulator.hand, radii=np.full((5, 4), 0.02))
    around = np.radians(np.arange(0.0, 360.0, 15.0))
    ring = np.column_stack([np.cos(around), np.sin(around), np.zeros(len(around))])
    field = Simulator(thick, pill, depth=0.008).field
    np.testing.assert_allclose(field.distance((0.005 + 0.02 + 0.008) * ring), 0.028, atol=1e-5)


def test_scene_holds_watertight_bodies_in_the_world(simulator):
    motion = Pose((0.3, -0.2, 0.1), tuple(Rotation.from_euler("xyz", [0.4, 0.2, -0.9]).as_quat(scalar_first=True)))
    there = Simulator(obj="mug", object_pose=motion)
    grasp = there.grasp(motion @ pose_of(there), -0.7)
    scene, opened = grasp_scene(there, grasp), grasp_scene(there, grasp, opened=True)
    assert len(scene.hand) == 21
    for body in (scene.object, *scene.hand, *opened.hand):
        assert body.vertices.dtype == np.float32
        assert body.faces.dtype == np.int32
        mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
        assert mesh.is_watertight, body.name
        assert mesh.volume > 0.0, f"{body.name} is inside out"
    surface = motion.inverse().apply(scene.points.astype(float))
    assert np.abs(there.field.distance(surface)).max() < 2e-4
    assert len(scene.bodies) == len(scene.points) == len(scene.weights) == len(grasp.contacts)
    assert len(opened.points) == 0
    palm = next(body for body in scene.hand if body.name == "palm")
    expected = 8 * np.prod(there.hand.palm_half_extents[0])
    assert 0.85 * expected < trimesh.Trimesh(palm.vertices, palm.faces, process=False).volume < expected


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"obj": "mugg"}, "did you mean 'mug'"),
        ({"hand": "barrett"}, "hand 'barrett' is unknown"),
        ({"hand": "jaw.yaml"}, r"hand\.files\.packaged_hand\('jaw\.yaml'\)"),
        ({"hand": "jaw.urdf"}, r"hand\.files\.load_hand\('jaw\.urdf', DESCRIPTION\)"),
        ({"obj": "box.stl"}, r"mug, .*object\.mesh_files\.load_mesh\('box\.stl'\)\.object"),
        ({"contact": "soft"}, "graded, patch, single"),
        ({"quality": "epsilom"}, "did you mean 'epsilon'"),
        ({"closing": "fast"}, "adaptive, synergy"),
        ({"friction": -0.1}, "friction is -0.1"),
        ({"friction": float("nan")}, "friction is nan"),
        ({"edges": 2}, "edges of the friction cone are 2"),
        ({"edges": True}, "edges"),
        ({"depth": 0.0}, "depth of the soft touch"),
        ({"depth": 0.1}, "depth of the soft touch"),
        ({"object_pose": Pose((0.0, 0.0, float("nan")))}, "object_pose"),
        ({"friction": 1e9}, "0 to 10"),
        ({"torsion": 1.0}, "torsion is 1.0 m"),
        ({"cones": "square"}, "polyhedral, round"),
        ({"quality": "simox", "friction": 0.5}, "friction is 0.5, but the quality 'simox' always has"),
        ({"quality": "simox", "torsion": 0.001}, "leave torsion out, or ask for another quality"),
        ({"quality": "simox", "edges": 16}, "edges are 16"),
        ({"collision": "ignored"}, "penalty, zero"),
        ({"convention": "unit"}, "normal_unit, unit_magnitude"),
        ({"task": [[0, 0, 1, 0, 0, 0]]}, "ask for quality='task'"),
        ({"task": [[0, 0, 1]], "quality": "task"}, "shape"),
        ({"task": np.zeros((1, 6)), "quality": "task"}, "not zero"),
    ],
)
def test_bad_options_are_explained(options, words):
    with pytest.raises(InputError, match=words):
        Simulator(**options)


BAD_POSES = {
    "NaN": (Pose((float("nan"), 0.0, 0.0)), "is not finite"),
    "zero quaternion": (Pose((0.2, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), "quaternion has no length"),
    "hardly a quaternion": (Pose((0.2, 0.0, 0.0), (0.0, 0.0, 0.0, 1e-200)), "quaternion has no length"),
    "beyond all rounding": (Pose((1e15, 0.0, 0.0)), "in meters"),
}


@pytest.mark.parametrize("name", BAD_POSES)
def test_poses_that_compiled_code_cannot_take_are_refused_by_all_that_take_one(simulator, name):
    pose, words = BAD_POSES[name]
    still = np.zeros((5, 4))
    with pytest.raises(InputError, match=words):
        simulator.grasp(pose)
    for at_rest in (simulator.quality_at, simulator.contacts_at, simulator.gaps):
        with pytest.raises(InputError, match=words):
            at_rest(pose, still)
    with pytest.raises(InputError, match=words):
        robust_quality(simulator, pose, n=2)
    with pytest.raises(InputError, match=words):
        Simulator(obj="mug", object_pose=pose)
    with pytest.raises(InputError, match=r"finite|in meters"):
        grasp_batch(simulator, [Pose(), pose])


def test_a_posture_may_be_a_scalar_of_numpy(simulator):
    pose = pose_of(simulator)
    grasp = simulator.grasp(pose, np.float32(-0.5))
    assert grasp.quality == simulator.grasp(pose, -0.5).quality
    assert len(grasp_scene(simulator, grasp).hand) == 21


def test_postures_that_are_not_finite_are_refused(simulator):
    with pytest.raises(InputError, match="s1 is inf"):
        simulator.grasp(Pose(), float("inf"))
    for wrong in ([-0.7], None, "x", (None,)):
        with pytest.raises(InputError, match=r"s1 is .*; give a finite number"):
            simulator.grasp(Pose(), wrong)


def test_joints_of_another_hand_and_without_value_are_refused(simulator):
    unknown = np.zeros((5, 4))
    unknown[1, 2] = np.nan
    name = simulator.hand.joint_names[6]
    for at_rest in (simulator.quality_at, simulator.contacts_at, simulator.gaps):
        with pytest.raises(InputError, match=r"shape \(2, 4\); give \(5, 4\)"):
            at_rest(pose_of(simulator), np.zeros((2, 4)))
        with pytest.raises(InputError, match=f"joint {name} is nan"):
            at_rest(pose_of(simulator), unknown)
        with pytest.raises(InputError, match="is 1e\\+300"):
            at_rest(pose_of(simulator), np.full((5, 4), 1e300))


def test_a_trial_calls_few_python_functions_of_its_own(simulator):
    """A trial takes about a millisecond: 182 calls for the names of 91 contacts, as before, would be a tenth of it."""
    pose, calls = pose_of(simulator), []
    simulator.grasp(pose, -0.7)
    sys.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_filename) if event == "call" else None)
    simulator.grasp(pose, -0.7)
    sys.setprofile(None)
    package = str(Path(surehold.__file__).parent)
    own = [name for name in calls if name.startswith(package)]
    assert 10 < len(own) < 100, len(own)
