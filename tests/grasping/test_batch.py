import pickle
from dataclasses import replace

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.grasping import OBJECTS, STATUSES, Pose, Simulator, default_pose, grasp_batch
from surehold.grasping.hand.named import hand_named
from surehold.grasping.hand.synergy import preshape_of
from surehold.grasping.trial_loop import UNDECIDED, run_trials


def random_poses(simulator, n, seed):
    rng, half = np.random.default_rng(seed), simulator.object.box_half_extents
    modes = ("right-front", "front-left", "top-left", "back-top")
    poses = [
        default_pose(
            simulator.hand,
            simulator.object,
            modes[rng.integers(4)],
            float(rng.uniform(0.01, 0.09)),
            rng.uniform(-1, 1, 6) * np.array([0.09, half[2], 0.02, 0.7, 0.7, 0.7]),
        )
        for _ in range(n)
    ]
    return poses, rng.uniform(-np.pi, np.pi, n)


@pytest.mark.parametrize("name", OBJECTS)
def test_a_batch_is_its_trials_and_sound(name):
    simulator = Simulator(obj=name)
    poses, s1 = random_poses(simulator, 120, 1)
    batch = grasp_batch(simulator, poses, s1)
    assert len(batch) == 120
    assert np.all(np.isfinite(batch.quality))
    assert sum(batch.shares().values()) == pytest.approx(1.0)
    assert np.mean(batch.fallbacks > 0) < 0.02
    assert np.any((batch.penetration > 0.0) & (batch.penetration < 0.002))
    for i in range(120):
        grasp = simulator.grasp(poses[i], float(s1[i]))
        assert batch.quality[i] == grasp.quality
        assert STATUSES[batch.status[i]] == grasp.status
        assert batch.penetration[i] == grasp.penetration
        assert batch.contacts[i] == len(grasp.contacts)


def test_a_batch_in_another_world_and_convention_is_its_trials():
    motion = Pose((0.3, -0.2, 0.1), (0.5, 0.5, 0.5, -0.5))
    simulator = Simulator(obj="mug", contact="single", convention="unit_magnitude", object_pose=motion)
    poses, s1 = random_poses(simulator, 150, 7)
    poses = [motion @ pose for pose in poses]
    batch = grasp_batch(simulator, poses, s1)
    assert np.any(batch.quality > 0.0)
    assert np.any(batch.contacts == 1)
    grasps = [simulator.grasp(pose, float(posture)) for pose, posture in zip(poses, s1, strict=True)]
    np.testing.assert_array_equal(batch.quality, [grasp.quality for grasp in grasps])
    assert [STATUSES[k] for k in batch.status] == [grasp.status for grasp in grasps]
    np.testing.assert_array_equal(batch.contacts, [len(grasp.contacts) for grasp in grasps])


def test_the_number_of_workers_changes_nothing():
    """The last worker takes what is left; memory that it does not fill holds another batch, the same one backwards."""
    simulator = Simulator(obj="mug")
    poses, s1 = random_poses(simulator, 230, 2)
    alone = grasp_batch(simulator, poses, s1)
    grasp_batch(simulator, poses[::-1], s1[::-1])
    together = grasp_batch(simulator, poses, s1, workers=2)
    for name in ("quality", "status", "penetration", "contacts", "fallbacks"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(together, name), err_msg=name)


def test_trials_that_rounding_spoils_are_made_again_by_themselves(monkeypatch):
    simulator = Simulator(obj="mug")
    poses, s1 = random_poses(simulator, 40, 4)
    expected = grasp_batch(simulator, poses, s1)

    def spoiled(*arguments):
        run_trials(*arguments)
        arguments[-1][5::7, :2] = np.nan, UNDECIDED

    monkeypatch.setattr("surehold.grasping.batch.run_trials", spoiled)
    found = grasp_batch(simulator, poses, s1)
    for name in ("quality", "status", "penetration", "contacts", "fallbacks"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def test_further_amplitudes_are_those_of_single_trials():
    hand = hand_named("icub-left")
    power = preshape_of(hand, "power")
    spread = np.zeros(power.start.shape)
    spread[:, 0] = np.linspace(-0.3, 0.3, len(spread))
    preshapes = {"power": power._replace(further=(spread,), further_ranges=((-1.0, 1.0),))}
    simulator = Simulator(hand=replace(hand, preshapes=preshapes), obj="mug")
    poses, s1 = random_poses(simulator, 60, 5)
    both = np.column_stack([s1, np.random.default_rng(6).uniform(-1.0, 1.0, 60)])
    batch, plain = grasp_batch(simulator, poses, both), grasp_batch(simulator, poses, s1)
    assert np.any(batch.quality != plain.quality)
    for i in np.flatnonzero(batch.quality > 0.0)[:6]:
        assert batch.quality[i] == simulator.grasp(poses[i], tuple(both[i].tolist())).quality


def test_a_simulator_travels_without_its_distance_field():
    simulator = Simulator(obj="bottle", contact="single", friction=0.4)
    content = pickle.dumps(simulator)
    assert len(content) < 2_000_000 < simulator.field.nodes.nbytes
    copy = pickle.loads(content)
    pose = default_pose(simulator.hand, simulator.object, "right-front", 0.0087, (-0.03, *[0.0] * 5))
    assert copy.grasp(pose, -0.7).quality == simulator.grasp(pose, -0.7).quality > 0.0


def test_empty_and_bad_input():
    simulator = Simulator(obj="bottle")
    assert len(grasp_batch(simulator, [])) == 0
    poses, _ = random_poses(simulator, 3, 3)
    with pytest.raises(InputError, match="one pose is given"):
        grasp_batch(simulator, poses[0])
    with pytest.raises(InputError, match=r"shape \(4,\); give poses, or matrices \(n, 3, 4\)"):
        grasp_batch(simulator, poses[0].matrix)
    four = np.stack([np.vstack([pose.matrix, [0.0, 0.0, 0.0, 1.0]]) for pose in poses])
    np.testing.assert_array_equal(grasp_batch(simulator, four).quality, grasp_batch(simulator, poses).quality)
    with pytest.raises(InputError, match="workers are 0"):
        grasp_batch(simulator, poses, workers=0)
    with pytest.raises(InputError, match=r"s1 has shape \(2,\)"):
        grasp_batch(simulator, poses, [0.0, 1.0])
    with pytest.raises(InputError, match="finite"):
        grasp_batch(simulator, poses, float("nan"))
    with pytest.raises(InputError, match=r"s1 has shape \(3, 2\), and preshape 'power' 1 amplitude"):
        grasp_batch(simulator, poses, np.zeros((3, 2)))
    np.testing.assert_array_equal(
        grasp_batch(simulator, poses, np.zeros((3, 1))).quality, grasp_batch(simulator, poses).quality
    )
    stretched = np.array([pose.matrix for pose in poses]) * [[[2.0, 2.0, 2.0, 1.0]]]
    for quality in ("epsilon", "closure"):
        with pytest.raises(InputError, match="no rotation"):
            grasp_batch(Simulator(obj="bottle", quality=quality), stretched)
