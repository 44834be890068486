import pickle

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.grasping import MODES, GraspObject, Simulator, default_pose, shipped_object
from surehold.grasping.object.solids import RoundedBox, triangles
from surehold.problems import GraspProblem
from surehold.problems.grasp.default_poses import GraspDefault, grasp_default, search_default
from surehold.problems.grasp.options import VARIABLES
from surehold.problems.problem import Problem


@pytest.fixture(scope="module")
def mug():
    return GraspProblem("mug", facet="right-front")


def test_default_problem_is_dx_and_dy_of_the_published_bounds(mug):
    assert isinstance(mug, Problem)
    assert mug.box.names == ("dx", "dy")
    assert mug.units == ("m", "m")
    half = shipped_object("mug").box_half_extents
    np.testing.assert_allclose(mug.box.upper, [half[1] + 0.025, half[2]])
    np.testing.assert_allclose(mug.box.lower, -mug.box.upper)


def test_value_is_the_quality_of_the_grasp(mug):
    x = [-0.057, 0.002]
    grasp = mug.grasp(x)
    assert grasp.status == "ok"
    assert mug(x) == grasp.quality > 0.05
    assert mug([0.0, 0.0]) < 0.0, "the open hand collides"
    np.testing.assert_array_equal(mug([x, [0.0, 0.0]]), [grasp.quality, mug([0.0, 0.0])])
    pose = default_pose(mug.simulator.hand, mug.object, "right-front", mug.default.standoff, [*x, 0, 0, 0, 0])
    assert mug.simulator.grasp(pose, mug.default.s1).quality == grasp.quality


def test_variables_in_any_subset_and_order_mean_the_same(mug):
    names = tuple(reversed(VARIABLES))
    every = GraspProblem("mug", variables=names)
    assert every.box.names == names
    assert every.units == tuple(VARIABLES[name] for name in names)
    x = {"dx": -0.057, "dy": 0.002, "s1": mug.default.s1} | dict.fromkeys(["dz", "rx", "ry", "rz"], 0.0)
    assert every([x[name] for name in names]) == mug([-0.057, 0.002])
    one = GraspProblem("mug", variables="dx", fixed={"dy": 0.002})
    assert one([-0.057]) == mug([-0.057, 0.002])
    closer = GraspProblem("mug", variables=["dx", "dz"], fixed={"dy": 0.002})
    assert closer([-0.057, -0.01]) != one([-0.057])


def test_dz_spans_the_published_distances():
    p = GraspProblem("mug", variables=("dz",))
    depth = shipped_object("mug").box_half_extents[0]
    nearest, farthest = p.default.standoff - p.box.upper[0], p.default.standoff - p.box.lower[0]
    assert nearest == pytest.approx(depth / 3)
    assert farthest == pytest.approx(depth / 3 + 0.040 * (1 + depth / 0.050))


def test_the_guess_is_the_default_pose_of_what_is_free_but_the_place_on_the_facet():
    assert GraspProblem("mug").guess == {}
    every = GraspProblem("mug", variables=("dx", "dy", "dz", "rx", "ry", "rz", "s1"))
    assert every.guess == {"dz": 0.0, "rx": 0.0, "ry": 0.0, "rz": 0.0, "s1": every.default.s1}
    x = [-0.057, 0.002, *every.guess.values()]
    assert every.pose(x) == GraspProblem("mug").pose(x[:2])
    near = GraspProblem("mug", variables=("dx", "rz", "s1"), bounds={"rz": (0.2, 0.4)}, fixed={"dy": 0.01})
    assert near.guess == {"rz": 0.2, "s1": near.default.s1}, "as near as the bounds allow"
    for name in ("bottle", "glass", "drill"):
        problem = GraspProblem(name, variables=("dx", "dy", "dz", "rx", "ry", "rz", "s1"))
        assert problem.box.contains([0.0, 0.0, *problem.guess.values()], tolerance=0.0)


def test_default_starts_30_to_70_percent_free_of_collision(mug):
    rng = np.random.default_rng(0)
    points = mug.box.from_unit(rng.uniform(size=(300, 2)))
    status = [mug.grasp(x).status for x in points]
    free = np.mean([s != "initial collision" for s in status])
    assert 0.25 < free < 0.75
    assert status.count("ok") > 20


def test_table_of_defaults_repeats_the_search(mug):
    assert search_default(mug.simulator, "right-front") == pytest.approx(mug.default, abs=1e-4)
    assert all(isinstance(grasp_default(mug.simulator, mode), GraspDefault) for mode in MODES)


def test_pickled_problem_gives_the_same_and_is_small(mug):
    text = pickle.dumps(mug)
    assert len(text) < 2_000_000, "the distance field is not sent along"
    again = pickle.loads(text)
    assert again.box == mug.box
    assert again([-0.057, 0.002]) == mug([-0.057, 0.002])


def test_options_reach_the_simulator():
    p = GraspProblem("mug", contact="single", closing="synergy", friction=0.8)
    assert isinstance(p.simulator, Simulator)
    assert (p.simulator.contact, p.simulator.closing, p.simulator.friction) == ("single", "synergy", 0.8)
    narrow = GraspProblem("mug", bounds={"dx": (-0.07, -0.05)})
    np.testing.assert_allclose([narrow.box.lower[0], narrow.box.upper[0]], [-0.07, -0.05])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"obj": "mugg"}, "did you mean 'mug'"),
        ({"facet": "lefft-front"}, "did you mean 'left'"),
        ({"facet": "right"}, "right-front"),
        ({"variables": ("dx", "dw")}, "variable 'dw' is unknown"),
        ({"variables": ("dx", "dx")}, "each once"),
        ({"variables": ()}, "name one or more"),
        ({"bounds": {"dz": (0.0, 0.1)}}, "not free"),
        ({"bounds": {"dx": (0.1, 0.0)}}, "lower must be smaller"),
        ({"fixed": {"dx": 0.1}}, "both free and fixed"),
        ({"fixed": {"s1": float("nan")}}, "finite"),
        ({"contact": "soft"}, "contact model"),
    ],
)
def test_bad_options_are_explained(options, words):
    with pytest.raises(InputError, match=words):
        GraspProblem(**options)


def test_bad_points_are_explained(mug):
    with pytest.raises(InputError, match="dx, dy"):
        mug([0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="finite"):
        mug([0.0, float("nan")])
    with pytest.raises(InputError, match="one point"):
        mug.grasp([[0.0, 0.0], [0.01, 0.0]])


def test_the_thesis_preset_is_the_original_experiment():
    problem = GraspProblem("bottle", variables=("dx", "s1"), preset="thesis")
    assert (problem.simulator.contact, problem.simulator.quality) == ("single", "simox")
    assert (problem.simulator.closing, problem.simulator.collision) == ("synergy", "zero")
    assert problem.box.upper[1] == pytest.approx(np.pi)
    assert 0.1 < problem([-0.03, -0.7]) < 1.0
    with pytest.raises(InputError, match="preset 'theses' is unknown"):
        GraspProblem("bottle", preset="theses")


def test_the_default_facet_of_the_drill_has_a_grasp_that_holds():
    drill = GraspProblem("drill")
    assert (GraspProblem("mug").facet, drill.facet) == ("right-front", "bottom-front")
    best = np.array([-0.018, -0.036])
    around = [drill(best + step) for step in 0.003 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])]
    assert drill(best) > 0.1
    assert min(around) > 0.1


def test_an_object_of_own_solids_has_its_default_searched():
    solids = (RoundedBox((0.0, 0.0, 0.04), (0.02, 0.03, 0.04), 0.004),)
    vertices, faces, volume, center = triangles(solids)
    for name in ("block", "mug"):  # also under the name of a shipped one
        own = GraspObject(name, vertices, faces, 900.0 * volume, center, 0.5, solids)
        problem = GraspProblem(own)
        assert 0.02 / 3.0 - 1e-4 <= problem.default.standoff <= 0.04 + 1e-4
        assert problem.facet == "right-front"
