import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping import Pose, PoseNoise, Simulator, default_pose, robust_quality
from surehold.grasping.pose_noise import disturbed_poses


@pytest.fixture(scope="module")
def bottle():
    return Simulator(obj="bottle")


def pose_at(simulator, dx):
    return default_pose(simulator.hand, simulator.object, "right-front", 0.0087, (dx, *[0.0] * 5))


def shifts(simulator, pose, poses):
    """Shift of the grasp center in the hand's frame, (n, 3), and turn angles, (n,)."""
    center = simulator.hand.grasp_center
    poses = [Pose.from_matrix(m) for m in poses]
    moved = np.array([pose.inverse().apply(p.apply(center)) - center for p in poses])
    turned = [np.arccos(np.clip((np.trace(pose.rotation.T @ p.rotation) - 1.0) / 2.0, -1.0, 1.0)) for p in poses]
    return moved, np.array(turned)


def test_the_disturbance_is_a_truncated_normal_about_the_grasp_center(bottle):
    pose = pose_at(bottle, -0.03)
    poses = disturbed_poses(bottle, pose, n=4000)
    moved, turned = shifts(bottle, pose, poses)
    assert np.abs(moved).max() <= 0.010
    assert turned.max() <= np.radians(5.0) * np.sqrt(3.0) + 1e-9
    for axis in range(3):
        assert stats.kstest(moved[:, axis], stats.truncnorm(-3, 3, scale=0.010 / 3).cdf).pvalue > 1e-3
    turns = [Rotation.from_matrix(pose.rotation.T @ p[:, :3]).as_euler("XYZ") for p in poses]
    for angles in np.transpose(turns):
        assert stats.kstest(angles, stats.truncnorm(-3, 3, scale=np.radians(5.0) / 3).cdf).pvalue > 1e-3
    assert len(disturbed_poses(bottle, pose)) == 24
    only_turns, _ = shifts(bottle, pose, disturbed_poses(bottle, pose, PoseNoise(shift=0.0), n=50))
    np.testing.assert_allclose(only_turns, 0.0, atol=1e-12)


@pytest.mark.parametrize("disturbed", ["hand", "object"])
def test_each_pose_is_disturbed_as_it_is_written(bottle, disturbed):
    """X -> c + Rx Ry Rz (x - c) + d, of truncated normals of a Halton sequence, by matrices (4, 4)."""
    pose, center = pose_at(bottle, -0.03), np.asarray(bottle.hand.grasp_center)
    draws = stats.truncnorm.ppf(stats.qmc.Halton(6, rng=3).random(8), -3, 3) / 3.0
    palm = np.vstack([pose.matrix[:3], [0, 0, 0, 1]])
    about = center if disturbed == "hand" else pose.apply(center)
    for found, draw in zip(disturbed_poses(bottle, pose, PoseNoise(0.02, 0.3), 8, 3, disturbed), draws, strict=True):
        rx, ry, rz = (Rotation.from_rotvec(0.3 * draw[3 + k] * np.eye(3)[k]).as_matrix() for k in range(3))
        D = np.eye(4)
        D[:3, :3] = rx @ ry @ rz
        D[:3, 3] = about - D[:3, :3] @ about + 0.02 * draw[:3]
        expected = palm @ D if disturbed == "hand" else np.linalg.inv(D) @ palm
        np.testing.assert_allclose(found, expected[:3], atol=1e-12)


def test_draws_are_common_and_without_noise_all_trials_are_alike(bottle):
    first, second = pose_at(bottle, -0.03), pose_at(bottle, -0.035)
    a, b = (shifts(bottle, p, disturbed_poses(bottle, p, n=20, seed=7)) for p in (first, second))
    np.testing.assert_allclose(a[0], b[0], atol=1e-12)
    still = robust_quality(bottle, first, -0.7, noise=PoseNoise(0.0, 0.0), n=5)
    exact = bottle.grasp(first, -0.7).quality
    assert still.std == pytest.approx(0.0, abs=1e-6)
    assert still.mean == pytest.approx(exact, rel=1e-4)


def test_numbers_are_those_of_the_trials(bottle):
    pose = pose_at(bottle, -0.017)
    found = robust_quality(bottle, pose, -0.7, n=60, seed=1)
    grasps = [bottle.grasp(Pose.from_matrix(p), -0.7) for p in disturbed_poses(bottle, pose, n=60, seed=1)]
    collided = np.array([g.status == "initial collision" for g in grasps])
    values = np.array([max(g.quality, 0.0) for g in grasps])
    assert 0.0 < found.collision_rate == collided.mean() < 1.0
    np.testing.assert_allclose(found.values, values, atol=1e-6)
    assert found.mean == found.values.mean()
    assert found.mean_free == pytest.approx(values[~collided].mean())
    assert found.mean_free > found.mean
    assert found.std == pytest.approx(np.std(values, ddof=1))
    assert found.worst == values.min() == 0.0
    assert found.closure_rate == np.mean([g.status == "ok" for g in grasps])
    assert found.closure_rate_free == pytest.approx(np.mean([g.status == "ok" for g in grasps]) / (1 - collided.mean()))
    assert found.quantile(0.5) == np.quantile(found.values, 0.5)
    again = robust_quality(bottle, pose, -0.7, n=60, seed=1)
    np.testing.assert_array_equal(again.values, found.values)


def test_disturbing_the_object_is_undoing_it_on_the_hand(bottle):
    motion = Pose((0.1, 0.2, -0.3), (0.5, 0.5, 0.5, -0.5))
    there = Simulator(obj="bottle", object_pose=motion)
    pose = motion @ pose_at(there, -0.03)
    for matrix in disturbed_poses(there, pose, n=5, disturbed="object"):
        moved = Pose.from_matrix(matrix)
        shift = moved @ pose.inverse()
        # the same relative pose, with the object moved the other way and the hand in place
        other = Simulator(obj="bottle", object_pose=shift.inverse() @ motion)
        assert other.grasp(pose, -0.7).quality == pytest.approx(there.grasp(moved, -0.7).quality, abs=1e-6)
        assert (
            np.linalg.norm(np.array(moved.apply(there.hand.grasp_center)) - pose.apply(there.hand.grasp_center)) < 0.018
        )


def test_a_grasp_beside_a_collision_is_worth_less(bottle):
    safe, brink = (robust_quality(bottle, pose_at(bottle, x), -0.7, n=80) for x in (-0.030, -0.014))
    assert safe.closure_rate > brink.closure_rate
    assert safe.mean > brink.mean
    assert brink.collision_rate > 0.1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"n": 0}, "number of disturbed trials is 0"),
        ({"n": 10**8}, "give an integer of 1 to 1,000,000"),
        ({"noise": PoseNoise(shift=-1.0)}, "pose noise"),
        ({"disturbed": "table"}, "hand, object"),
        ({"workers": 0}, "workers are 0"),
    ],
)
def test_bad_options_are_explained(bottle, options, words):
    with pytest.raises(InputError, match=words):
        robust_quality(bottle, pose_at(bottle, -0.03), -0.7, **options)
