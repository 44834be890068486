"""Two settings of one study in words."""

import pytest

from surehold.problems.grasp.options import checked_words
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

#: As 0.1.0 stored it: it knew no clouds and no preset, and a name had a space.
EARLIER = {
    "object": "mug",
    "facet": "right-front",
    "variables": ["dx", "dy"],
    "contact": "graded",
    "quality": "epsilon",
    "unit": "",
    "mass": None,
    "frame": None,
    "friction": None,
    "hand": "icub-left",
    "hand config": "",
    "preshape": "",
    "closing": "adaptive",
}


@pytest.fixture(scope="module")
def space():
    return SearchSpace({"dx": (-0.08, 0.08), "dy": (-0.05, 0.05)})


#: As the command stores what it asks for.
NOW = checked_words({"object": "mug", "facet": "right-front", "variables": ["dx", "dy"]})


def settings(space, words):
    return StudySettings(space, problem={"grasp": words})


def test_options_that_an_earlier_version_did_not_know_are_at_their_defaults(space):
    now = settings(space, NOW)
    assert settings(space, EARLIER).differences(now) == []


def test_an_option_that_is_asked_for_now_is_named_alone(space):
    now = settings(space, NOW | {"friction": 0.8, "cones": "polyhedral"})
    assert settings(space, EARLIER).differences(now) == [
        "grasp: {'friction': None, 'cones': 'round'} in the study, {'friction': 0.8, 'cones': 'polyhedral'} now"
    ]
