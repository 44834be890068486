"""What a robot tells of a touch: what is missing is named, and what cannot be together is refused."""

import re

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.grasp.exploration import Exploration, belief_of_size
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.grasp.told_contacts import checked_against, contacts_told

BELIEF = belief_of_size((0.06, 0.06, 0.2))
UP = [0.0, 0.0, 1.0]
SIDE = {"point": [0.03, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"contacts": [SIDE, {"point": [0, 0, 0]}]}, "contact 1 of contacts has no 'normal', but point; give"),
        ({"contacts": [{"normals": UP, "point": UP}]}, "contact 0 of contacts has no 'normal', but normals, point"),
        ({"contacts": [{}]}, "contact 0 of contacts has no 'point', but nothing"),
        ({"contacts": [SIDE, [0, 0, 0]]}, "contact 1 of contacts is '[0, 0, 0]'"),
        ({"contacts": [{**SIDE, "normal": [1, "x", 0]}]}, "normal of contact 0 of contacts is [1, 'x', 0]; give 3"),
        ({"contacts": [{**SIDE, "point": [10**400, 0, 0]}]}, "point of contact 0 of contacts is [1000"),
        ({"contacts": [SIDE], "free": [[0, 0, 1, 0.1], [0, 0, 1]]}, "free ball 1 of contacts is [0, 0, 1]; give 4"),
        ({"contacts": [SIDE], "free": 3}, "'free' of contacts is '3'"),
        ({"contacts": SIDE}, "no list 'contacts'"),
        ([SIDE], "no list 'contacts'"),
    ],
)
def test_what_is_missing_is_named_with_the_number_of_its_contact(told, said):
    with pytest.raises(InputError, match=re.escape(said)) as error:
        contacts_told(told)
    assert "\n" not in str(error.value)


def test_a_contact_inside_space_told_free_is_refused_with_its_number():
    top = {"point": [0.0, 0.0, 0.1], "normal": UP}
    free = [[0.2, 0.0, 0.0, 0.05], [0.05, 0.0, 0.0, 0.03]]  # the second holds the place of the side, 10 mm inside
    with pytest.raises(
        InputError, match=r"contact 1 of contacts is 10\.0 mm inside free ball 1 of contacts \[0\.05, 0"
    ):
        checked_against(BELIEF.surface, contacts_told({"contacts": [top, SIDE], "free": free}))
    before = contacts_told({"contacts": [top], "free": free})
    with pytest.raises(InputError, match=r"contact 0 of contacts is 10\.0 mm inside a free ball that was told before"):
        checked_against(BELIEF.surface, contacts_told({"contacts": [SIDE]}), before=[before])


def test_free_space_that_holds_a_contact_told_before_is_refused_with_its_number():
    run = Exploration(GraspProblem("bottle"), BELIEF, InputNoise.unit(0.03))
    before = contacts_told({"contacts": [SIDE]})
    run.restore(np.empty((0, 2)), np.empty(0), [before])
    ball = contacts_told({"contacts": [], "free": [[0.2, 0.0, 0.0, 0.05], [0.05, 0.0, 0.0, 0.03]]})
    said = r"free ball 1 of contacts, .*, holds a known point of the surface, \[0\.03, 0\.0, 0\.0\], 10\.0 mm inside"
    with pytest.raises(InputError, match=said):
        checked_against(run.belief.surface, ball, before=[before])


def test_free_space_up_to_a_contact_is_taken():
    """A finger that swept up to the touch, and a millimeter more by noise, contradicts nothing."""
    told = contacts_told({"contacts": [SIDE], "free": [[0.05, 0.0, 0.0, 0.021]]})
    checked_against(BELIEF.surface, told, before=[told])
    run = Exploration(GraspProblem("bottle"), BELIEF, InputNoise.unit(0.03))
    run.restore(np.empty((0, 2)), np.empty(0), [told])
    checked_against(run.belief.surface, told, before=[told])


def test_a_study_refuses_them_when_they_are_told():
    pytest.importorskip("optuna")
    from optuna.trial import TrialState, create_trial

    from surehold.studies.history import CONTACTS
    from surehold.studies.touch import TouchedShape

    shape = TouchedShape({"box": [0.06, 0.06, 0.2], "facet": "right-front"}, InputNoise.unit(0.03), 0)
    free = {"contacts": [], "free": [[0.05, 0.0, 0.0, 0.03]]}
    known = create_trial(state=TrialState.COMPLETE, value=0.1, user_attrs={CONTACTS: free})
    assert shape.checked({"contacts": [SIDE]}, []) == {"contacts": [SIDE]}
    with pytest.raises(InputError, match="inside a free ball that was told before"):
        shape.checked({"contacts": [SIDE]}, [known])


def test_a_study_refuses_what_leaves_no_object():
    """The answer was taken, and nothing could be asked of the study any more."""
    pytest.importorskip("optuna")
    from surehold.studies.touch import TouchedShape

    shape = TouchedShape({"box": [0.06, 0.06, 0.2], "facet": "right-front"}, InputNoise.unit(0.03), 0)
    with pytest.raises(InputError, match="no object is left: free balls take its whole room"):
        shape.checked({"contacts": [], "free": [[0.0, 0.0, 0.0, 0.3]]}, [])
    beside = {"contacts": [], "free": [[0.1, 0.0, 0.0, 0.05]]}
    assert shape.checked(beside, []) == beside
