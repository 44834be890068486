from itertools import pairwise

import numpy as np
import pytest

from surehold.grasping.closing.contacts import DEPTH, SKIN, add_outcome, end_mixture, pass_share
from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.skin import skin_samples
from surehold.grasping.object.solids import signed_distance
from surehold.grasping.poses import default_pose
from surehold.grasping.simulator import Simulator


@pytest.fixture(scope="module")
def graded():
    return Simulator(obj="mug", contact="graded")


def side_pose(simulator, dx, dy=0.0, standoff=0.021):
    return default_pose(simulator.hand, simulator.object, "right-front", standoff, (dx, dy, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("model", ["graded", "patch", "single"])
def test_contacts_lie_on_the_surface_and_point_into_the_object(model):
    simulator = Simulator(obj="mug", contact=model)
    for dx in (-0.055, -0.060, -0.065):
        contacts = simulator.grasp(side_pose(simulator, dx), -0.7).contacts
        assert len(contacts) >= 2
        distance, gradient = signed_distance(simulator.object.solids, contacts.points + 1e-6 * -contacts.normals)
        assert np.percentile(np.abs(distance - 1e-6), 95) < 5e-6
        assert np.abs(distance).max() < 2e-4
        np.testing.assert_allclose(np.linalg.norm(contacts.normals, axis=1), 1.0, atol=1e-12)
        assert np.median(np.sum(-contacts.normals * gradient, axis=1)) > 0.9999
        assert np.all((contacts.weights > 0.0) & (contacts.weights <= 1.0))
        if model != "graded":
            assert np.all(contacts.weights == 1.0)
        assert all(
            name == "palm" or name.split()[1] in ("knuckle", "proximal", "middle", "distal") for name in contacts.names
        )


def test_single_has_one_contact_for_each_touching_link():
    simulator = Simulator(obj="mug", contact="single")
    grasp = simulator.grasp(side_pose(simulator, -0.06), -0.7)
    assert grasp.contacts.names == grasp.touching
    assert len(set(grasp.touching)) == len(grasp.touching)


def test_patch_is_graded_with_full_weight(graded):
    patch = Simulator(obj="mug", contact="patch")
    a, b = (s.grasp(side_pose(s, -0.06), -0.7).contacts for s in (graded, patch))
    np.testing.assert_allclose(a.points, b.points, atol=5e-6)  # the touches are found to 5 micrometers
    np.testing.assert_array_equal(b.weights, 1.0)
    assert a.weights.min() < 0.3


def test_every_touching_link_is_felt_by_the_skin(graded):
    for dx in (-0.07, -0.065, -0.06, -0.055):
        grasp = graded.grasp(side_pose(graded, dx), -0.7)
        for name in grasp.touching:
            weights = [w for w, n in zip(grasp.contacts.weights, grasp.contacts.names, strict=True) if n == name]
            assert weights, f"{name} touches, but no sample is near"
            assert max(weights) > 0.6, name


def test_a_palm_that_lies_on_the_object_is_felt():
    simulator = Simulator(obj="drill", contact="graded")
    lowest, highest = -0.02, 0.15
    for _ in range(45):  # the closest standoff without collision
        middle = 0.5 * (lowest + highest)
        pose = default_pose(simulator.hand, simulator.object, "front-top", middle, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        if simulator.grasp(pose, 0.9).status == "initial collision":
            lowest = middle
        else:
            highest = middle
    pose = default_pose(simulator.hand, simulator.object, "front-top", highest, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    gaps = simulator.gaps(pose, simulator.grasp(pose, 0.9).open_joints)
    assert gaps.min() == pytest.approx(0.0, abs=1e-6)
    assert np.argmin(gaps) == simulator.hand.palm
    assert simulator.hand.palm in simulator.grasp(pose, 0.9).contacts.bodies


@pytest.mark.parametrize("depth", [DEPTH, DEPTH / 2])
@pytest.mark.parametrize(
    ("name", "mode", "standoff", "dx", "s1"),
    [("mug", "right-front", 0.021, -0.06, -0.7), ("drill", "front-top", 0.014, 0.0, 0.9)],  # the palm 1 mm away
)
def test_a_hand_at_rest_feels_each_sample_of_its_skin_by_the_exact_distance(name, mode, standoff, dx, s1, depth):
    """The weight is 1 - d / depth; point and normal are those of the surface nearest to a place below the skin."""
    simulator = Simulator(obj=name, depth=depth)
    hand, solids = simulator.hand, simulator.object.solids
    grasp = simulator.grasp(default_pose(hand, simulator.object, mode, standoff, (dx, *[0.0] * 5)), s1)
    assert grasp.status != "initial collision"
    felt = simulator.contacts_at(grasp.pose, grasp.joints)
    bodies, skin = np.split(skin_samples(hand), [1], axis=1)
    frames = np.concatenate([link_frames(hand.bases, hand.chains, grasp.joints), np.eye(3, 4)[None]])
    frames = frames[bodies[:, 0].astype(int)]
    places = np.einsum("mij,mj->mi", frames[:, :, :3], skin[:, :3]) + frames[:, :, 3]
    below = grasp.pose.apply(places - SKIN * np.einsum("mij,mj->mi", frames[:, :, :3], skin[:, 3:]))
    distance = signed_distance(solids, grasp.pose.apply(places))[0]
    near = distance < depth
    assert near.sum() > 15
    assert (hand.palm in felt.bodies) == (name == "drill")
    np.testing.assert_array_equal(felt.bodies, bodies[near, 0])
    np.testing.assert_allclose(felt.weights, np.minimum(1.0 - distance[near] / depth, 1.0), atol=1e-3)
    beneath, outward = signed_distance(solids, below[near])
    np.testing.assert_allclose(felt.points, below[near] - beneath[:, None] * outward, atol=1e-5)
    np.testing.assert_allclose(felt.normals, -outward, atol=2e-3)


@pytest.mark.parametrize("dy", [-0.01, 0.0, 0.015])
def test_graded_quality_is_continuous_along_dx_and_single_is_not(graded, dy):
    """In steps of 0.125 mm no jump above 3 % of the mean, away from collisions."""
    single = Simulator(obj="mug", contact="single")
    steps = np.arange(-0.068, -0.054, 0.000125)
    values = np.array([[s.grasp(side_pose(s, x, dy), -0.7).quality for x in steps] for s in (graded, single)])
    roughness = np.abs(np.diff(values, axis=1)).max(axis=1) / values.mean(axis=1)
    assert values.min() > 0.0
    assert roughness[0] < 0.03
    assert roughness[1] > 0.03, "the one contact of a link comes and goes"


def test_contacts_fade_out_at_the_depth(graded):
    deep = Simulator(obj="mug", contact="graded", depth=DEPTH / 2)
    pose = side_pose(graded, -0.06)
    assert len(deep.grasp(pose, -0.7).contacts) < len(graded.grasp(pose, -0.7).contacts)


def test_a_narrow_hit_fades_into_a_narrow_miss():
    """Where the thumb begins to go past the bottle the joint angles jump, and the quality does not."""
    simulator = Simulator(obj="bottle")
    poses = [
        default_pose(simulator.hand, simulator.object, "right-front", 0.0087, (x, 0.0, 0.0, 0.0, 0.0, 0.0))
        for x in np.arange(-0.0510, -0.0460, 0.000125)
    ]
    grasps = [simulator.grasp(pose, -0.7) for pose in poses]
    assert len({"thumb distal" in g.touching for g in grasps}) == 2, "on one side it misses"
    jumps = [np.abs(a.joints - b.joints).max() for a, b in pairwise(grasps)]
    assert max(jumps) > 0.5
    quality = np.array([g.quality for g in grasps])
    assert quality[0] < 0.2 * quality[-1]
    bend = np.abs(quality[:-2] - 2.0 * quality[1:-1] + quality[2:]) / 2.0
    assert bend.max() < 0.01 * 0.1
    assert np.abs(np.diff(quality)).max() < 0.005


def test_the_share_of_a_pass():
    assert pass_share(0.0, 0.01, 0.003) == 1.0
    assert pass_share(0.003, 0.01, 0.003) == 0.0
    assert pass_share(0.0015, 0.01, 0.003) == pytest.approx(0.5)
    assert pass_share(0.001, 0.001, 0.003) == 0.0, "what stays is no pass"
    assert pass_share(0.0015, 0.0018, 0.003) == pytest.approx(0.5 * 0.4)
    assert pass_share(-1e-6, 0.01, 0.003) == 1.0


def test_blending_is_the_mean_force_at_the_mean_place():
    a = np.array([[0.0, 0, 0, 1, 0, 0, 1.0, 3], [0, 0, 0, 0, 0, 0, 0, 3], [1, 0, 0, 1, 0, 0, 0.5, 3]])
    b = np.array([[0.0, 1, 0, 0, 1, 0, 1.0, 3], [0, 1, 0, 0, 1, 0, 0.8, 3], [1, 0, 0, -1, 0, 0, 0.5, 3]])
    mixed = mixture((0.5, a), (0.5, b))
    np.testing.assert_allclose(mixed[0], [0, 0.5, 0, np.sqrt(0.5), np.sqrt(0.5), 0, np.sqrt(0.5), 3])
    np.testing.assert_allclose(mixed[1], [0, 1, 0, 0, 1, 0, 0.4, 3])
    assert mixed[2, 6] == 0.0
    np.testing.assert_allclose(
        mixture((1.0, a), (0.0, b)), a * (a[:, 6:7] > 0.0) + [[0] * 7 + [3]] * (a[:, 6:7] == 0.0)
    )
    np.testing.assert_array_equal(mixture((0.5, a), (0.5, b), first=4), a)


def mixture(*outcomes, first=3):
    total, rows = np.zeros((3, 8)), outcomes[0][1].copy()
    for share, contacts in outcomes:
        add_outcome(total, contacts, share, first, 9)
    end_mixture(total, rows, first, 9)
    return rows
