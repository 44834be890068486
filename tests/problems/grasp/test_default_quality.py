import pytest

from surehold.problems import GraspProblem
from surehold.problems.grasp.options import VARIABLES, checked_words
from surehold.problems.grasp.stored import stored_words

SEVEN = tuple(VARIABLES)


@pytest.mark.parametrize(
    ("variables", "options", "quality"),
    [
        (("dx", "dy"), {}, "epsilon"),
        (("dx", "dy", "dz"), {}, "epsilon"),
        (("dx", "dy", "dz", "rx"), {}, "signed_epsilon"),
        (SEVEN, {}, "signed_epsilon"),
        (SEVEN, {"quality": "epsilon"}, "epsilon"),
        (SEVEN, {"preset": "thesis"}, "simox"),
    ],
)
def test_the_quality_is_signed_where_few_poses_hold_and_none_is_named(variables, options, quality):
    assert GraspProblem("bottle", variables=variables, **options).simulator.quality == quality
    assert checked_words({"variables": variables, **options})["quality"] == quality


def test_a_file_of_grasps_keeps_the_quality_that_it_was_planned_with():
    assert stored_words({"variables": SEVEN})["quality"] == "signed_epsilon"
    assert "quality" not in stored_words({})


def test_in_seven_variables_a_hand_that_touches_nothing_is_told_how_far_it_is_away():
    problem = GraspProblem("mug", variables=SEVEN)
    middle = 0.5 * (problem.box.lower + problem.box.upper)
    near, far = (problem.grasp([dx, *middle[1:]]) for dx in (0.06, 0.08))
    assert near.status == far.status == "no contact"
    assert far.quality < near.quality < 0.0
