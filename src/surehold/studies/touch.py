"""A study of an object whose shape is not known: trials tell contacts, and the next is asked from what they say.

The study's problem is `{"touch": words}`: the words of a grasp (surehold.problems.grasp.options), with a cloud, or with
"box": the edges of the object's box [m], whose middle is then the origin of the object's frame; and "goal", as of
`Exploration`. What is asked follows from settings and stored trials alone.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from optuna.trial import FrozenTrial, TrialState

from surehold.errors import InputError, SureholdError
from surehold.grasping.shape.implicit_surface import Observations
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.grasp.description import described_grasp
from surehold.problems.grasp.exploration import Exploration, belief_of_size
from surehold.problems.grasp.told_contacts import checked_against, contacts_told
from surehold.studies.history import CONTACTS, REACHED, history_of
from surehold.studies.recommendation import StudyRecommendation
from surehold.studies.search_space import SearchSpace

__all__ = ["TouchedShape"]

_SHAPES: Final = 4  #: that are drawn to see whether an object is left


class TouchedShape:
    """What is known of the shape of a study's object.

    Parameters
    ----------
    words
        See above.
    noise
        Input noise of the hand.
    seed
        Of all draws.

    Attributes
    ----------
    problem : the grasps of the believed object

    Raises
    ------
    InputError
        If the words are refused, or there is no input noise.
    """

    def __init__(self, words: Mapping[str, Any], noise: InputNoise | None, seed: int):
        if noise is None:
            raise InputError("a study of an unknown shape needs input noise; give what the hand strays, such as 0.03.")
        grasp = {key: value for key, value in words.items() if key not in ("box", "goal")}
        if words.get("box"):
            self._belief = belief_of_size(words["box"], mass=grasp.get("mass"))
        else:
            from surehold.problems.grasp.from_cloud import belief_of_file

            self._belief = belief_of_file(grasp)[0]
        self.problem: Final = described_grasp({"object": "", **grasp}, self._belief.mean_object())
        self._goal, self._noise, self._seed = words.get("goal") or "grasp", noise, seed

    def suggest(self, trials: Sequence[FrozenTrial], space: SearchSpace) -> dict[str, Any]:
        """Return the parameters of the next trial."""
        run = self._told(trials, space)
        return space.complete(self.problem.box.as_dict(run.ask(history_of(trials, space).pending)))

    def recommend(self, trials: Sequence[FrozenTrial], space: SearchSpace) -> StudyRecommendation:
        """Return the trial of highest expected value under shape and hand noise, of those that held if any did.

        What is expected is of the shapes that are possible; of what was told of the value its sign alone counts. Raises
        InputError if no trial has told one.
        """
        run = self._told(trials, space)
        history = history_of(trials, space)
        if not np.isfinite(history.y).any():
            raise InputError("no trial has given a value yet; tell one first.")
        answer = run.recommend(tried=True)
        gaps = np.abs(history.reached - answer.x).max(axis=1)
        row, best = int(np.argmin(gaps)), int(np.nanargmax(history.y))
        trial = next(t for t in trials if t.number == history.numbers[row])
        return StudyRecommendation(
            trial.params | trial.user_attrs.get(REACHED, {}),
            trial.number,
            answer.mean,
            answer.std,
            answer.quantile,
            float(np.nan_to_num(history.y[row])),
            int(history.numbers[best]),
            float(history.y[best]),
            int(np.isfinite(history.y).sum()),
            "" if row == best else "On the shapes that are possible it holds less well when the hand is off.",
        )

    def checked(self, told: Any, trials: Sequence[FrozenTrial]) -> dict[str, Any]:
        """Return what was told of contacts, if it can be; raises InputError else."""
        found = contacts_told(told)
        surface = self._belief.surface
        before = [c for t in trials if (c := t.user_attrs.get(CONTACTS)) and c != told and t.state.is_finished()]
        felt = [contacts_told(c) for c in before]
        if felt:
            run = Exploration(self.problem, self._belief, self._noise)
            run.restore(np.empty((0, self.problem.box.dimension)), np.empty(0), felt)
            surface = run.belief.surface
        checked_against(surface, found, before=felt)
        self._check_room([*felt, found])
        return dict(told)

    def _check_room(self, felt: Sequence[Observations]) -> None:
        """Refuse what leaves no shape: nothing could be asked of the study afterwards."""
        run = Exploration(self.problem, self._belief, self._noise)
        try:
            run.restore(np.empty((0, self.problem.box.dimension)), np.empty(0), felt)
            possible = run.belief.objects(_SHAPES, np.random.default_rng(self._seed))
        except SureholdError:
            possible = []
        if len(possible) < 2:  # the mean, and a shape that keeps out of all that is free
            raise InputError(
                "with these contacts no object is left: free balls take its whole room, or contacts contradict each "
                "other; leave out balls that reach beyond what the hand swept, give meters in the object's frame, and "
                "normals out of the object."
            )

    def pose(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return where the palm goes, in the object's frame, and the posture."""
        x = np.array([parameters[name] for name in self.problem.box.names], dtype=np.float64)
        pose = self.problem.pose(x)
        return {
            "position": [float(v) for v in pose.position],
            "quaternion": [float(v) for v in pose.quaternion],
            "s1": self.problem.posture(x),
        }

    def _told(self, trials: Sequence[FrozenTrial], space: SearchSpace) -> Exploration:
        history = history_of(trials, space)
        known = np.isfinite(history.y)
        lowest = float(history.y[known].min()) if known.any() else 0.0
        run = Exploration(self.problem, self._belief, self._noise, self._goal, seed=self._seed)
        finished = sorted((t for t in trials if t.state in (TrialState.COMPLETE, TrialState.FAIL)), key=_number)
        contacts = [contacts_told(t.user_attrs[CONTACTS]) for t in finished if CONTACTS in t.user_attrs]
        run.restore(history.reached, np.where(known, history.y, min(lowest, 0.0)), contacts)
        return run


def _number(trial: FrozenTrial) -> int:
    return trial.number
