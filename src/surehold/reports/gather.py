"""From a finished run to the data of its report: candidates, traces, and scenes."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.maximization import Result
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.recommendation import MANY_OUTSIDE, outliers_in_words, outside_in_words
from surehold.optimization.variables import Number
from surehold.problems.perturbation import RobustScore
from surehold.reports.run_report import (
    Candidate,
    RunReport,
    Scene,
    Surface,
    Variable,
    extreme_of,
)
from surehold.reports.surfaces import surfaces_of

__all__ = ["answers", "candidate", "kept_in_box", "report_of"]

_SHARES = (0.9, 0.99)  # of executions that succeed, of which the page says how sure they are
_ADVICE = "Give more trials, a wider box, or count as success what is easier to reach."


def answers(result: Result) -> dict[str, int]:
    """Return the trials to show by label, the best "observed" and "recommended"; one entry if they are the same."""
    box = result.optimizer.box
    reached = result.optimizer.reached
    apart = np.abs(box.to_unit(reached) - _unit_answer(result))
    if box.uncontrolled is not None:  # an answer has no condition: trials are of what can be set
        apart = apart[:, ~box.uncontrolled.held]
    recommended = int(np.argmin(np.where(np.isfinite(result.y), apart.max(axis=1), np.inf)))
    if result.optimizer.outcome == "success":  # a trial that succeeded is no peak
        return {"recommended": recommended}
    highest = result.best_index
    if recommended == highest or np.array_equal(reached[recommended], reached[highest]):
        return {"recommended": highest}
    return {f"{_extreme(result)} observed": highest, "recommended": recommended}


def candidate(
    result: Result,
    label: str,
    index: int,
    score: RobustScore | None,
    *,
    status: str = "",
    pose: str = "",
    details: Mapping[str, str] | None = None,
    scene: Scene | None = None,
) -> Candidate:
    """Return the candidate of trial `index` with its re-queries; what the model expects of it where that is known."""
    best, optimizer = result.recommendation, result.optimizer
    counted = optimizer.outcome == "success"
    if label == "recommended" and counted:
        sure = {
            f"sure that at least {100 * share:.0f} % of executions succeed": best.probability_of_share(share)
            for share in _SHARES
        }
        details = {**{name: f"{100.0 * p:.0f} %" for name, p in sure.items()}, **(details or {})}
    return Candidate(
        label,
        optimizer.reached[index],
        float(result.y[index]),
        index,
        np.empty(0) if score is None else score.values,
        np.empty((0, result.X.shape[1])) if score is None else score.points,
        0 if score is None else score.n_failed,
        status=status,
        pose=pose,
        details=details or {},
        scene=scene,
        minimized=optimizer.direction == "minimize",
        risk=optimizer.risk,
        without_value=float(np.nanmax(result.y) if optimizer.direction == "minimize" else np.nanmin(result.y)),
        **_predicted(result, label == "recommended", index, score is not None),
    )


def _predicted(result: Result, recommended: bool, index: int, queried: bool) -> dict[str, Any]:
    """Return what the model expects of a trial under the noise; of one that is not the answer where nobody looked."""
    best, optimizer = result.recommendation, result.optimizer
    disturbed = optimizer.input_noise is not None or optimizer.box.uncontrolled is not None
    found: dict[str, Any] = {}
    if recommended and (disturbed or queried or optimizer.outcome == "success"):
        found = {"predicted_mean": best.mean, "predicted_error": best.expectation.std}
    if recommended and (disturbed or queried):
        found |= {"predicted_std": best.std, "predicted_worth": best.by_risk}
    if not recommended and disturbed and not queried:
        x = optimizer.reached[index][None, :]
        mean, error = optimizer.predict(x, under_noise=True)
        worth = None if best.by_risk is None else float(optimizer.risk_measure(x)[0])
        found = {"predicted_mean": float(mean[0]), "predicted_error": float(error[0]), "predicted_worth": worth}
    return found


def _of_constraints(result: Result) -> list[str]:
    """Return in words what was required besides a good value, and why the best one told is no answer."""
    best, trials = result.recommendation, result.optimizer.feasible
    found: list[str] = []
    if best.outputs:
        expected = ", ".join(f"{name} {outcome.mean:.4g}" for name, outcome in best.outputs.items())
        found.append(
            f"Expected of the recommended input besides: {expected}; {best.feasible:.1%} of executions keep all "
            f"limits. {int(trials.sum())} of {len(trials)} trials are feasible."
        )
    reported = int(np.any(result.optimizer.reached != result.X, axis=1).sum())
    if reported:
        found.append(f"Trials are shown where they were, which {reported} of {len(trials)} told.")
    if _extreme(result).endswith("feasible"):
        found.append(best.refused)
    return found


def report_of(
    result: Result,
    candidates: Sequence[Candidate],
    *,
    title: str,
    settings: Mapping[str, Any],
    noise: InputNoise | None,
    units: Mapping[str, str] | None = None,
    quality_name: str = "",
    disturbance: str = "the input is off",
    planned_trials: int | None = None,
    notes: Sequence[str] = (),
    choices: Mapping[str, tuple[str, ...]] | None = None,
    hidden: Collection[str] = (),
    success_above: float | None = None,
    outcomes: Mapping[str, int] | None = None,
    advice: str = "",
    surfaces: tuple[Surface, ...] | None = None,
) -> RunReport:
    """Return the report of a run: its trials, its candidates, its traces and its model.

    Parameters
    ----------
    noise
        The input noise that the candidates were scored with, whether or not the optimizer knew of it.
    units
        Unit of each variable by name, such as {"dx": "m", "rx": "rad"}.
    choices
        Text of each trial for parameters that are no numbers, by name.
    hidden
        Coordinates of the box that say nothing to a reader: those in which the choices are coded.
    quality_name
        By default "value", or "success" where trials succeed or fail.
    success_above, outcomes, advice
        Of `RunReport`: what counts as a success, and what is said where there was none. Where trials succeed or fail, a
        share above 0 does.
    surfaces
        Those of a report of the same trials and places, if there is one: drawing a model takes its time.

    Raises
    ------
    InputError
        If a unit names a variable that is not there.
    """
    optimizer = result.optimizer
    box = optimizer.box
    for name in units or {}:
        if name not in box.names:
            raise InputError(
                f"unit given for '{name}', which is no variable; the variables are {', '.join(box.names)}."
            )
    shown = [i for i, name in enumerate(box.names) if name not in hidden]
    held = np.zeros(box.dimension, dtype=bool) if box.uncontrolled is None else box.uncontrolled.held
    whole = {variable.name for variable in box.variables if isinstance(variable, Number) and variable.integer}
    variables = tuple(
        Variable(name, float(lower), float(upper), (units or {}).get(name, ""), bool(drawn), name in whole)
        for name, lower, upper, drawn in zip(box.names, box.lower, box.upper, held, strict=True)
        if name not in hidden
    )
    y, minimized, counted = result.y, optimizer.direction == "minimize", optimizer.outcome == "success"
    robust = np.full(y.size, np.nan)
    averaged = optimizer.input_noise is not None or box.uncontrolled is not None
    for place, trial in enumerate(result.trials[: y.size]):
        if trial.recommendation is not None and averaged:
            robust[place] = trial.recommendation.worth
    called = [trial.index for trial in result.trials] if len(result.trials) == y.size else list(range(y.size))
    ids = () if called == list(range(y.size)) else tuple(called)
    missing = ["Trials have the ids of the study; those that are missing have told nothing."] if ids else []
    report = RunReport(
        title=title,
        variables=variables,
        X=optimizer.reached[:, shown],
        y=y,
        n_initial=optimizer.n_initial,
        best_trace=_running_best(np.where(_countable(result) & (not counted), y, np.nan), minimized),
        candidates=tuple(
            replace(
                candidate,
                x=candidate.x[shown],
                points=candidate.points[:, shown] if candidate.points.size else candidate.points,
                noise=None if noise is None else _covariance_at(noise, box, candidate.x)[np.ix_(shown, shown)],
            )
            for candidate in candidates
        ),
        settings={**settings, **({} if optimizer.risk.name == "mean" else {"risk": str(optimizer.risk)})},
        seed=optimizer.seed,
        quality_name=quality_name or ("success" if counted else "value"),
        disturbance=disturbance,
        robust_trace=robust if np.isfinite(robust).any() else None,
        success_above=0.0 if counted and success_above is None else success_above,
        outcomes=outcomes or {},
        advice=advice or _ADVICE * counted,
        infeasible=result.recommendation.infeasible,
        surfaces=surfaces_of(optimizer, noise, [c.x for c in candidates], shown) if surfaces is None else surfaces,
        warning=result.recommendation.warning,
        interrupted=result.interrupted,
        planned_trials=planned_trials,
        notes=(
            *notes,
            *missing,
            *_of_constraints(result),
            *filter(None, [outliers_in_words([called[i] for i in result.recommendation.outliers])]),
        ),
        choices=choices or {},
        parameters=tuple(box.as_given(x) for x in optimizer.reached),
        outputs=_outputs(result),
        feasible=None if np.array_equal(optimizer.feasible, np.isfinite(y)) else optimizer.feasible,
        minimized=minimized,
        normal_noise=noise is not None and noise.kind.gaussian,
        counted=counted,
        ids=ids,
    )
    border = outside_in_words(result.recommendation.outside)
    return replace(report, notes=(*report.notes, border)) if border and report.succeeded else report


def kept_in_box(scores: Mapping[tuple[str, int], RobustScore | None], result: Result) -> list[str]:
    """Return in words how many re-queries would have left the box, where many would and were kept in it."""
    nobody, parts = result.optimizer.box.uncontrolled, []
    for (label, index), score in scores.items():
        if score is not None:
            held = (score.points == result.X[index]) & (np.ptp(score.points, axis=0) > 0.0)
            if nobody is not None:
                held &= ~nobody.held
            count, n = int(np.any(held, axis=1).sum()), len(score.points)
            if count >= MANY_OUTSIDE * n:
                parts.append(f"{count} of {n} of the {label} point")
    kept = "a variable that would have left it kept its commanded value"
    return [f"Re-queries stay in the box: {kept} (in {', '.join(parts)})."] if parts else []


def _covariance_at(noise: InputNoise, box: Box, x: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the covariance (d, d) of the noise at x, in the units of the box."""
    return noise.unit_covariance(box, x) * np.outer(box.widths, box.widths)


def _unit_answer(result: Result) -> NDArray[np.float64]:
    return result.optimizer.box.to_unit(result.recommendation.x)


def _outputs(result: Result) -> dict[str, tuple[Any, ...]]:
    """Return the further outputs of the trials by name, None where a trial told none."""
    names = dict.fromkeys(name for trial in result.trials for name in trial.outputs)
    if len(result.trials) != len(result.y):
        return {}
    return {name: tuple(trial.outputs.get(name) for trial in result.trials) for name in names}


def _countable(result: Result) -> NDArray[np.bool_]:
    """Tell which trials may be the best one, (t,): the feasible ones, or all where none is."""
    feasible = result.optimizer.feasible
    return feasible if feasible.any() else np.ones(len(result.y), dtype=bool)


def _extreme(result: Result) -> str:
    return extreme_of(result.y, float(result.y[result.best_index]), result.optimizer.direction == "minimize")


def _running_best(y: NDArray[np.float64], minimized: bool) -> NDArray[np.float64]:
    return (np.fmin if minimized else np.fmax).accumulate(y)
