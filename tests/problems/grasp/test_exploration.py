import json
from dataclasses import replace

import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.poses import Pose
from surehold.grasping.shape.implicit_surface import spaced
from surehold.grasping.simulator import Simulator
from surehold.problems.grasp.exploration import Exploration, belief_of_box, belief_of_size
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.grasp.shape_loss import shape_loss
from surehold.problems.grasp.told_contacts import contacts_of_file, touches
from surehold.problems.grasp.touch import touch_trial

NOISE = sh.InputNoise.unit(0.03)
BOTTLE = shipped_object("bottle")
PROBLEM = GraspProblem(BOTTLE)


def a_grasp():
    grid = np.stack(np.meshgrid([0.2, 0.35, 0.5, 0.65], [0.3, 0.5, 0.7]), axis=-1).reshape(-1, 2)
    return next(x for x in PROBLEM.box.from_unit(grid) if len(PROBLEM.grasp(x).touching) > 3)


@pytest.fixture(scope="module")
def explored():
    run = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    touches = []
    for _ in range(4):
        x = run.ask()
        touch = touch_trial(PROBLEM.simulator, PROBLEM.pose(x), PROBLEM.posture(x))
        run.tell(x, touch.grasp.quality, touch.observations)
        touches.append(touch)
    return run, touches


def test_what_is_felt_lies_on_the_true_surface_and_what_is_swept_is_free(explored):
    run, touches = explored
    field = PROBLEM.simulator.field
    felt = sum((t.observations for t in touches[1:]), start=touches[0].observations)
    assert len(felt.points) > 8
    assert np.abs(field.distance(felt.points)).max() < 2e-4
    assert np.sum(field.gradient(felt.points) * felt.slopes, axis=1).min() > 0.95
    assert np.all(field.distance(felt.free[:, :3]) > felt.free[:, 3] - 1e-4)
    assert len(run.X) == len(run.y) == 4


@pytest.mark.parametrize("tried", [0, 1])
def test_two_of_three_new_places_keep_the_default_pose(tried):
    problem = GraspProblem(BOTTLE, variables=("dx", "dy", "dz", "rz", "s1"))
    run = Exploration(problem, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2)
    run.restore(problem.box.from_unit(np.full((tried, 5), 0.3)), np.full(tried, 0.1), [])
    new = run._candidates()[16 * tried :]  # behind the steps around the best trial
    kept = np.isclose(new[:, 2:], list(problem.guess.values()), rtol=0.0, atol=1e-9).all(axis=1)
    assert kept.tolist() == [k % 3 != 2 for k in range(48 - 16 * tried)]
    assert len(np.unique(new[:, :2], axis=0)) == len(new), "dx and dy are anywhere"


def test_the_surface_moves_to_what_was_felt(explored):
    run, touches = explored
    before = belief_of_box(BOTTLE).surface
    points = np.vstack([t.observations.points for t in touches])
    assert np.abs(run.belief.surface.value(points)).mean() < 0.0015
    assert np.abs(run.belief.surface.value(points)).mean() < 0.3 * np.abs(before.value(points)).mean()
    assert np.all(run.belief.surface.deviation(points) < 0.3 * before.std)


def test_a_large_box_costs_no_more_than_a_small_one():
    large = belief_of_size([0.9, 0.7, 0.4])
    assert 0.8 * 100_000 < np.prod(large.grid.shape) <= 100_000
    assert large.grid.cell > belief_of_size([0.06, 0.06, 0.1]).grid.cell == 0.004


def test_space_that_is_swept_again_and_again_is_kept_once(explored):
    run, touches = explored
    again = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    swept = touches[0].observations
    for _ in range(3):
        again.tell(run.X[0], 0.0, swept)
    once = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    once.tell(run.X[0], 0.0, swept)
    assert len(swept.free) > 0
    assert np.array_equal(again.belief.free, once.belief.free)


def test_a_skin_that_tells_hundreds_of_contacts_costs_no_more_than_one_that_tells_some():
    """Twenty trials of 400 contacts made a covariance of 8 GB, and no trial could be asked for any more."""
    belief = belief_of_size([0.07, 0.07, 0.12])
    run = Exploration(PROBLEM, belief, NOISE, shapes=2)
    rng = np.random.default_rng(0)
    angle, height = rng.uniform(0.0, 2.0 * np.pi, 2000), rng.uniform(-0.05, 0.05, 2000)
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(2000)])
    told = touches(0.035 * outward + height[:, None] * [0.0, 0.0, 1.0], outward)
    run.restore(np.empty((0, PROBLEM.box.dimension)), np.empty(0), [told])
    assert 300 < len(run.belief.surface.observations.points) <= 600
    off = np.abs(run.belief.surface.value(told.points))  # those that were left out as well
    assert np.quantile(off, 0.95) < 1e-3
    few = Exploration(PROBLEM, belief, NOISE, shapes=2)
    some = touches(told.points[:50], told.slopes[:50])
    few.restore(np.empty((0, PROBLEM.box.dimension)), np.empty(0), [some])
    assert np.array_equal(few.belief.surface.observations.points, some.points)


def test_space_that_is_swept_far_from_the_object_is_not_kept(explored):
    run, touches = explored
    near = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    far = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    felt = touches[0].observations
    near.tell(run.X[0], 0.0, felt)
    far.tell(run.X[0], 0.0, replace(felt, free=np.vstack([felt.free, [[0.4, 0.0, 0.05, 0.01]]])))
    assert np.array_equal(far.belief.free, near.belief.free)
    assert 0 < len(near.belief.free) < len(felt.free)  # a hand sweeps more than that
    once = felt.free[spaced(felt.free[:, :3], 0.008)]
    everything = replace(near.belief, free=once)
    drawn = [belief.values(1, np.random.default_rng(0)) for belief in (near.belief, everything)]
    assert np.array_equal(*drawn)


def test_the_next_trial_follows_from_what_was_told(explored):
    run, touches = explored
    again = Exploration(PROBLEM, belief_of_box(BOTTLE, cell=0.006), NOISE, shapes=2, seed=1)
    for x, touch in zip(run.X, touches, strict=True):
        again.tell(x, touch.grasp.quality, touch.observations)
    assert np.array_equal(again.ask(), run.ask())
    answer = run.recommend()
    assert PROBLEM.box.contains(answer.x)
    assert np.isfinite(answer.mean)


def test_exploring_for_the_shape_goes_where_it_is_not_known(explored):
    run, _ = explored
    curious = Exploration(PROBLEM, run.belief, NOISE, "shape", shapes=0, seed=1)
    imagined = curious._imagined()
    candidates = curious._candidates()
    chosen = curious._unknown(imagined, curious.ask())
    assert chosen == max(curious._unknown(imagined, x) for x in candidates)


def test_a_probe_ends_at_the_first_contact():
    x = a_grasp()
    pose, s1 = PROBLEM.pose(x), PROBLEM.posture(x)
    whole, probe = (touch_trial(PROBLEM.simulator, pose, s1, only).observations for only in (False, True))
    assert 0 < len(probe.points) < len(whole.points)


def test_a_hand_that_meets_the_object_on_its_way_feels_it():
    x = PROBLEM.box.from_unit(np.full(2, 0.5))
    pose = PROBLEM.pose(x)
    deep = Pose(tuple(np.asarray(pose.position) + 0.03 * pose.rotation[:, 2]), pose.quaternion)
    touch = touch_trial(PROBLEM.simulator, deep, PROBLEM.posture(x))
    assert touch.grasp.status == "initial collision"
    assert len(touch.observations.points) > 0
    assert np.abs(PROBLEM.simulator.field.distance(touch.observations.points)).max() < 2e-4


def test_value_over_draws_is_the_mean_over_simulators():
    wider = replace(BOTTLE, friction=0.9)
    both = replace(BOTTLE, draws=(BOTTLE, wider))
    unknown = PROBLEM.on(both)
    x = a_grasp()
    expected = [Simulator(obj=obj).grasp(PROBLEM.pose(x), PROBLEM.posture(x)).quality for obj in (BOTTLE, wider)]
    assert expected[0] != expected[1]
    assert unknown.over_shapes(x).tolist() == expected
    assert unknown(x) == pytest.approx(np.mean(expected), abs=1e-15)
    assert GraspProblem("bottle", variables=PROBLEM.box.names, plan="mean").on(both)(x) == expected[0]
    with pytest.raises(InputError, match="did you mean 'shapes'"):
        GraspProblem("bottle", plan="shape")


def test_losses_sum_to_what_is_lost():
    wider = replace(BOTTLE, friction=0.9)
    unknown = PROBLEM.on(replace(BOTTLE, draws=(BOTTLE, wider)))
    x = a_grasp()
    loss = shape_loss(unknown, x, NOISE, n=5)
    assert loss.nominal - loss.pose - loss.shape == pytest.approx(loss.robust, abs=1e-12)
    known = PROBLEM.on(replace(BOTTLE, draws=(BOTTLE, BOTTLE)))
    assert shape_loss(known, x, NOISE, n=5).shape == pytest.approx(0.0, abs=1e-12)


def test_an_unknown_goal():
    with pytest.raises(InputError, match="goal 'shap' is unknown; did you mean 'shape'"):
        Exploration(PROBLEM, belief_of_box(BOTTLE), NOISE, "shap")


def test_contacts_of_a_file(tmp_path):
    path = tmp_path / "contacts.json"
    path.write_text(json.dumps({"contacts": [{"point": [0.0, 0.026, 0.05], "normal": [0.0, 1.0, 0.0]}]}))
    told = contacts_of_file(path)
    assert told.points.tolist() == [[0.0, 0.026, 0.05]]
    assert told.slopes.tolist() == [[0.0, 1.0, 0.0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "are not read"),
        ('{"touches": []}', "hold no list 'contacts'"),
        ('{"contacts": []}', "hold 0 touches"),
        ('{"contacts": [{"point": [0, 0, 0], "normal": [0, 0, 3]}]}', "contact 0"),
        ('{"contacts": [{"point": [0, 0, NaN], "normal": [0, 0, 1]}]}', "contact 0"),
    ],
)
def test_contacts_that_are_none(tmp_path, text, said):
    path = tmp_path / "contacts.json"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as error:
        contacts_of_file(path)
    assert "\n" not in str(error.value)
