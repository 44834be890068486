"""A stored study as the result of a run, as reports want it: what would have been recommended after each trial."""

from dataclasses import replace
from typing import Final

import numpy as np

from surehold.errors import InputError
from surehold.optimization.maximization import Result, Trial
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.recommendation import Outcome, Recommendation
from surehold.studies.history import History, history_of
from surehold.studies.ledger import NOTE, VETOED
from surehold.studies.recommendation import StudyRecommendation
from surehold.studies.robot import RobotStudy

__all__ = ["result_of"]

_REPLAYED: Final = 60  # recommendations that are computed again


def result_of(study: RobotStudy, interrupted: bool = False) -> Result:
    """Return the told trials of a study as a `Result`; recommendations at up to 60 of them, evenly spread.

    Of a study about a shape that is touched the only one is the last, that of `RobotStudy.recommend`. The trials have
    the ids of the study, of which some may have told nothing.

    Raises
    ------
    InputError
        If no trial has given a value, at an allowed input, yet.
    """
    stored = {trial.number: trial for trial in study.trials()}
    history = history_of(stored.values(), study.settings.space, outputs=study.sampler.outputs)
    n = len(history.y)
    optimizer = study.sampler.optimizer(study.study)
    values = optimizer.y  # where trials succeed or fail, a failed one is one that did not succeed
    if not np.isfinite(values).any():
        raise InputError(f"study '{study.name}' has no trial with a value yet; there is nothing to show.")
    first = max(study.n_initial, int(np.argmax(np.isfinite(values))) + 1)
    replayed = {n} if study.touches else set(np.linspace(min(first, n), n, _REPLAYED).round().astype(int).tolist())
    recommendations: dict[int, Recommendation] = {}
    for count in sorted(replayed):
        optimizer.restore(
            history.X[:count],
            history.y[:count],
            reached=history.reached[:count],
            outputs=history.outputs[:count],
            of=history.executions[:count],
        )
        try:
            recommendations[count] = optimizer.recommend()
        except InputError:  # there was no answer yet: the trials so far were at inputs that are not allowed
            if count == n:
                raise
    if study.touches:
        recommendations[n] = _by_shape(study.recommend(write=False), recommendations[n], optimizer, history)
    sign = 1.0 if study.settings.direction == "maximize" else -1.0
    best = sign * np.fmax.accumulate(sign * values)
    trials = []
    for i in range(n):
        attributes = stored[int(history.numbers[i])].user_attrs
        failure = "" if np.isfinite(history.y[i]) else attributes.get(VETOED) or attributes.get(NOTE) or "failed"
        x, y = history.X[i], float(values[i])
        number, answer, parameters = int(history.numbers[i]), recommendations.get(i + 1), optimizer.box.as_dict(x)
        measured = zip(study.sampler.outputs, history.outputs[i].tolist(), strict=True)
        outputs = {name: value for name, value in measured if np.isfinite(value)}
        trials.append(Trial(number, x, y, failure, float(best[i]), answer, 0.0, outputs, parameters))
    return Result(optimizer, tuple(trials), recommendations[n], interrupted)


def _by_shape(
    best: StudyRecommendation, other: Recommendation, optimizer: Optimizer, history: History
) -> Recommendation:
    """Return the answer of a study about a shape in place of that of the model of the values."""
    row = int(np.flatnonzero(history.numbers == best.trial)[0])
    outcome = Outcome(np.array([best.mean]), np.array([best.std]))
    return replace(
        other,
        x=history.reached[row],
        mean=best.mean,
        std=best.std,
        quantile=best.quantile,
        observed=best.observed,
        refused=best.refused,
        warning="",
        execution=outcome,
        expectation=outcome,
        parameters=optimizer.box.as_dict(history.reached[row]),
        outside={},
    )
