"""The safe answer of a study, written into it: Optuna's `study.best_trial` is the highest spike that was hit.

Written as the study's attribute `surehold:recommendation` and as its note, which optuna-dashboard shows.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np
from optuna.study import Study

from surehold.errors import InputError
from surehold.optimization.recommendation import in_digits, outliers_in_words, outside_in_words
from surehold.studies.dashboard_note import read_note, write_note
from surehold.studies.history import REACHED
from surehold.studies.sampler import Sampler, direction_of

__all__ = ["RECOMMENDATION", "StudyRecommendation", "find_recommendation", "recommend", "written"]

#: Study attribute that holds the recommendation last written.
RECOMMENDATION: Final = "surehold:recommendation"
_SHARES: Final = (0.9, 0.99)  # of executions that succeed, of which the model says how sure it is
_END: Final = "*Written by surehold; notes of your own below this line are kept.*"


@dataclass(frozen=True)
class StudyRecommendation:
    """The parameters to use, and what to expect of them when the input is off; values in the study's direction."""

    parameters: dict[str, Any]
    trial: int
    """number of the trial that was made there"""
    mean: float
    """expected outcome under the input noise"""
    std: float
    """standard deviation of one execution: input noise, observation noise and what the model does not know"""
    quantile: float
    """value that 95 % of executions are better than"""
    observed: float
    """value that was told for the trial"""
    best_trial: int
    """number of the best observed trial, as in Optuna"""
    best_value: float
    """its value"""
    n: int
    """trials with a value that the recommendation rests on"""
    refused: str
    """why the best observed trial is not recommended; empty where it is"""
    outliers: tuple[int, ...] = ()
    """numbers of the trials whose values are too far on the bad side of all others to be believed"""
    warning: str = ""
    """what is wrong with the model that all this rests on; empty where nothing is"""
    feasible: float = 1.0
    """probability that one execution keeps all limits of the further outputs, without the noise of observations"""
    infeasible: str = ""
    """why nothing feasible is known; empty where something is"""
    outputs: dict[str, float] = field(default_factory=dict)
    """what is expected of the further outputs, by name"""
    sure: dict[str, float] = field(default_factory=dict)
    """where trials succeed or fail: how sure the model is that at least this share of executions succeed, by share"""
    by_risk: float | None = None
    """what they are expected to be worth by the risk measure that was asked for; None where that is the mean"""
    risk: str = "mean"
    """that measure, in words"""
    outside: dict[str, float] = field(default_factory=dict)
    """share of executions that leave the ranges, where nothing can be tried, by parameter"""

    @property
    def expected(self) -> str:
        """What is expected of executions, in words."""
        if self.sure:
            more = ", ".join(
                f"{probability:.0%} sure of at least {float(s):.0%}" for s, probability in self.sure.items()
            )
            return f"{self.mean:.1%} of executions succeed; 95% sure of at least {self.quantile:.1%}, {more}"
        mean, quantile = in_digits(self.mean, self.std), in_digits(self.quantile, self.std)
        measured = "" if self.by_risk is None else f", {self.risk} {in_digits(self.by_risk, self.std)}"
        return f"{mean} ± {self.std:.2g}, 95 % better than {quantile}{measured}"

    @property
    def worth(self) -> float:
        """What they are expected to be worth by what was asked for: `by_risk`, or the mean."""
        return self.mean if self.by_risk is None else self.by_risk

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self) | {"outliers": list(self.outliers)}


def recommend(study: Study, sampler: Sampler | None = None) -> StudyRecommendation:
    """Return the trial whose outcome under the input noise is expected best, and write it into the study.

    Parameters
    ----------
    study
        A study of Optuna.
    sampler
        By default the study's own.

    Raises
    ------
    InputError
        If the sampler is not surehold's, the study has several objectives, or no trial has given a value yet.
    """
    return written(study, find_recommendation(study, sampler))


def written(study: Study, found: StudyRecommendation) -> StudyRecommendation:
    """Write a recommendation into a study, as attribute and note, and return it."""
    if study.user_attrs.get(RECOMMENDATION) != found.as_dict():
        study.set_user_attr(RECOMMENDATION, found.as_dict())
    backend, study_id = study._storage, study._study_id
    units = study.user_attrs.get("surehold:settings", {}).get("units", {})
    before = read_note(backend, study_id)
    note = note_of(found, study.study_name, units) + before.partition(_END)[2]
    if note != before:
        write_note(backend, study_id, note)
    return found


def find_recommendation(study: Study, sampler: Sampler | None = None) -> StudyRecommendation:
    """Return what `recommend` does, and write nothing."""
    sampler = sampler or study.sampler  # type: ignore[assignment]
    if not isinstance(sampler, Sampler):
        raise InputError(f"the study's sampler is {sampler}; load the study with a surehold.Sampler, or give one.")
    direction = direction_of(study)
    sign = 1.0 if direction == "maximize" else -1.0
    trials = study.get_trials(deepcopy=False)
    space = sampler.search_space(study)
    history = sampler.history(trials, space)
    with sampler.optimizing(space, history, direction) as optimizer:
        best, success, risk = optimizer.recommend(), optimizer.outcome == "success", optimizer.risk
        y = optimizer.y  # where trials succeed or fail, a failed one is one that did not succeed
        told = np.flatnonzero(np.isfinite(y))
        distance = np.abs(optimizer.box.to_unit(history.reached[told]) - optimizer.box.to_unit(best.x)).max(axis=1)
        # what was reached outside of the ranges cannot be commanded: the nearest place that can is the answer
        inside = [optimizer.box.contains(place) for place in history.reached]
    same = told[distance <= distance.min() + 1e-9]
    row, best_row = int(same[np.argmax(sign * y[same])]), int(np.nanargmax(sign * y))
    number, best_number = int(history.numbers[row]), int(history.numbers[best_row])
    trial = next(t for t in trials if t.number == number)
    return StudyRecommendation(
        trial.params | (trial.user_attrs.get(REACHED, {}) if inside[row] else best.parameters),
        number,
        best.mean,
        best.std,
        best.quantile,
        float(y[row]),
        best_number,
        float(y[best_row]),
        best.n,
        best.refused if number != best_number else "",
        tuple(int(history.numbers[i]) for i in best.outliers),
        best.warning,
        best.feasible,
        best.infeasible,
        {name: outcome.mean for name, outcome in best.outputs.items()},
        {f"{share:g}": best.probability_of_share(share) for share in _SHARES} if success else {},
        best.by_risk,
        risk.words(direction == "minimize"),
        dict(best.outside),
    )


def note_of(found: StudyRecommendation, name: str, units: Mapping[str, str]) -> str:
    """Return the recommendation as text in Markdown; units by parameter."""
    lines = [
        f"**Recommended for {name}: trial {found.trial}**",
        "",
        "| parameter | value |",
        "| --- | --- |",
        *(f"| {key} | {_shown(value)} {units.get(key, '')} |" for key, value in found.parameters.items()),
        "",
        f"Expected: {found.expected}. It gave {in_digits(found.observed, found.std)} when it was tried. {found.n} "
        "trials with a value.",
    ]
    if found.outputs:
        expected = ", ".join(f"{name} {_shown(value)}" for name, value in found.outputs.items())
        lines += ["", f"Expected besides: {expected}; {found.feasible:.1%} of executions keep all limits."]
    if found.infeasible:
        lines += ["", found.infeasible[:1].upper() + found.infeasible[1:]]
    if found.refused:
        lines += ["", f"Not trial {found.best_trial}, the best observed one. {found.refused}"]
    for more in (outside_in_words(found.outside), outliers_in_words(found.outliers), found.warning):
        lines += ["", more] if more else []
    return "\n".join([*lines, "", _END])


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
