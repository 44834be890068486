"""The verdict of a run in words, made from its numbers: why the highest peak was refused, or why not."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from surehold.amounts import amount
from surehold.reports.run_report import Candidate, RunReport
from surehold.reports.wording import change, coordinates, halved, number, percent, worth

_RESAMPLES: Final = 1000
_NOTABLE: Final = 0.1  # share of the range of the values met from which on bad cases count as different

__all__ = ["Verdict", "verdict"]


@dataclass(frozen=True)
class Verdict:
    """What the reader should know first."""

    headline: str  #: one sentence
    text: str  #: a short paragraph with the numbers
    refused: bool  #: whether the highest trial was refused for a lower one, and the re-queries bear it out


def _said(report: RunReport) -> Callable[[float | None], str]:
    return partial(worth, report)


def verdict(report: RunReport) -> Verdict:
    """Return headline and paragraph for a run; the paragraph ends with what is wrong with the model."""
    found = _of_the_run(report)
    headline = f"{found.headline}{_without_value(report)}"
    return replace(found, headline=headline, text=f"{found.text} {report.warning}".strip())


def _of_the_run(report: RunReport) -> Verdict:
    highest, answer = report.observed, report.recommended
    extreme, peak = report.extreme, f"{report.extreme} {'dip' if report.minimized else 'peak'}"
    falls = "rises" if report.minimized else "falls"
    name, off, said = report.quality_name, report.disturbance, _said(report)
    told = report.y[~report.failed]
    if not report.succeeded:
        return _of_nothing(report)
    if report.counted:
        return _of_successes(report)
    if told.size > 1 and told.max() == told.min():
        return Verdict(
            f"All {amount(told.size, 'trial')} gave the same {name}, {said(float(told[0]))}: nothing was found.",
            "There is no better or worse to learn from yet, so the point shown is only the first. Run more trials, or "
            "narrow the search to where outcomes differ.",
            False,
        )
    if answer.n_failed and not answer.values.size:
        return Verdict(
            f"The recommended point does not hold: when {off}, all {answer.n_failed} re-queries of it failed.",
            f"Hit exactly it gave {said(answer.quality)}, at {coordinates(report, answer)} "
            f"({_trial_of(report, answer)}). Nothing is known of it when {off}: find out why they failed.",
            False,
        )
    if highest.n_failed and not highest.values.size and answer.values.size:
        return Verdict(
            f"The {peak} ({said(highest.quality)}) was refused: when {off}, all {highest.n_failed} re-queries of it "
            f"failed, the recommended point is worth {said(answer.worth)} {report.manner}.",
            _sentence(report, answer, "The recommended point"),
            True,
        )
    if highest.values.size == 0 and answer.values.size == 0 and answer.predicted_mean is not None:
        return _of_the_model(report)
    if highest.values.size == 0 or answer.values.size == 0:
        why = f"No re-queries with perturbed inputs were made, so nothing is said here about what happens when {off}."
        return Verdict(
            f"The best{' feasible' * extreme.endswith('feasible')} {name} found is {said(highest.quality)}.",
            f"It was met at {coordinates(report, highest)} ({_trial_of(report, highest)}). {why}",
            False,
        )
    if len(report.candidates) == 1:
        if report.robust_trace is None:
            why = f"The method looks for the {extreme} value and does not ask what happens when {off}."
        else:
            why = "The model expects no other trial to hold better."
        measured = "" if report.risk.name in ("mean", "worst") else f", {said(answer.worth)} {report.manner}"
        return Verdict(
            f"The {extreme} trial is also the recommended one: {said(answer.quality)} when hit exactly, "
            f"{said(answer.mean)} on average{measured} and {said(answer.worst)} at worst when {off}.",
            f"{_sentence(report, answer, 'The recommended point')} {why}",
            False,
        )
    gap, error = _difference(report)
    by, plain = report.manner, report.risk.name == "mean"
    text = (
        f"{_sentence(report, highest, f'The {extreme} point')} {_sentence(report, answer, 'The recommended point')} "
        f"{'The means' if plain else f'{by[0].upper()}{by[1:]} they'} differ by {number(abs(gap))} "
        f"({f'standard error {number(error, 2)}, ' * (report.risk.name != 'worst')}both points shaken alike)."
    )
    tied = abs(gap) <= 2.0 * error or said(highest.worth) == said(answer.worth)
    lost, kept = halved(highest), halved(answer)
    if tied and lost - kept > 2.0 * math.sqrt(lost + kept):
        headline = (
            f"The {peak} ({said(highest.quality)}) was refused: when {off} it loses more than half in "
            f"{lost} of {highest.values.size} cases, the recommended point in {kept or 'none'}."
        )
        return Verdict(headline, text, True)
    tail = 0 if report.risk.name == "worst" else _tail(report)
    means, worsts = (f"{said(highest.worth)} and {said(answer.worth)}", f"{said(highest.worst)} at worst")
    if tied and tail > 0:
        headline = (
            f"The {peak} ({said(highest.quality)}) was refused: when {off} it {falls} to {worsts}, the "
            f"recommended point to {said(answer.worst)}; {by} they are worth about the same, {means}."
        )
        return Verdict(headline, text, True)
    if tied and tail < 0:
        headline = (
            f"When {off}, the {extreme} trial and the recommended one are worth about the same {by} ({means}), "
            f"but the recommended one {falls} to {said(answer.worst)} at worst, the other to {said(highest.worst)}."
        )
        return Verdict(headline, text, False)
    if tied:
        and_at_worst = f", {said(highest.worst)} and {said(answer.worst)} at worst" * (report.risk.name != "worst")
        headline = (
            f"When {off}, the {extreme} trial and the recommended one are worth about the same: {means} {by}"
            f"{and_at_worst}."
        )
        return Verdict(headline, text, False)
    measured = "" if plain else f" {by}"
    if gap > 0.0:
        deeper = _better(report, highest.worst, answer.worst) > _notable(report)
        yet = f", but {falls} to {said(answer.worst)} at worst (the other to {said(highest.worst)})" * deeper
        at = "as high as" if report.minimized else "worth only"
        headline = (
            f"The {peak} ({said(highest.quality)}) was refused: when {off} it is {at} {said(highest.worth)}{measured}, "
            f"the recommended point {said(answer.worth)}{yet}."
        )
        return Verdict(headline, text, True)
    holds = f", although it {falls} only to {said(answer.worst)} at worst (the other to {said(highest.worst)})"
    headline = (
        f"The model preferred another point, but the re-queries do not bear it out: when {off} it is worth "
        f"{said(answer.worth)}{measured}, the {peak} {said(highest.worth)}{holds * (tail > 0)}."
    )
    text += " More trials near both points would let the model see this."
    return Verdict(headline, text, False)


def _without_value(report: RunReport) -> str:
    """Return in words how many re-queries of a point gave no value, where others did."""
    some = [c for c in report.candidates if c.n_failed and c.values.size and report.succeeded]
    return "".join(
        f" {c.n_failed} of {c.values.size + c.n_failed} re-queries of the {c.label} point failed." for c in some
    )


def _of_nothing(report: RunReport) -> Verdict:
    """Return the verdict where no trial succeeded: no winner among them."""
    if report.infeasible:
        return Verdict(
            report.infeasible[:1].upper() + report.infeasible[1:],
            f"The point shown ({_trial_of(report, report.recommended)}) comes nearest and is no answer. "
            "Widen the limits, or the box.",
            False,
        )
    counts = sorted(report.outcomes.items(), key=lambda item: -item[1])
    ended = "; ".join(f"{n} × {status}" for status, n in counts)
    met = f": no {report.quality_name} above {number(report.success_above)} was met" * (not report.counted)
    return Verdict(
        f"None of {amount(report.y.size, 'trial')} succeeded{met}.",
        f"{f'How they ended: {ended}. ' if ended else ''}The point shown is no answer. {report.advice}".strip(),
        False,
    )


def _of_successes(report: RunReport) -> Verdict:
    """Return the verdict where trials succeed or fail: how often the recommended input does."""
    answer, told = report.recommended, report.y[~report.failed]
    expected = f"expected to succeed in {percent(answer.predicted_mean)} of executions"
    again = ""
    if answer.values.size:
        again = f"; of {answer.values.size} tried again when {report.disturbance}, {percent(answer.mean)} succeeded"
    where = f"{coordinates(report, answer)} ({_trial(report, answer)})"
    sure = " ".join(f"The model is {value} {name}." for name, value in answer.details.items() if name[:5] == "sure ")
    share = percent(float(told.mean()))
    made = f"{share} of the {amount(told.size, 'trial')} succeeded"
    if np.any((told > 0.0) & (told < 1.0)):
        made = f"The {amount(told.size, 'trial')} succeeded in {share} of their executions on average"
    return Verdict(
        f"The recommended point is {expected}{again}.",
        f"It is {where}. {made}, those made to learn included. {sure}".strip(),
        False,
    )


def _notable(report: RunReport) -> float:
    """Return from which difference on bad cases count as different, in the units of the values."""
    told = report.y[~report.failed]
    return _NOTABLE * float(told.max() - told.min())


def _tail(report: RunReport) -> int:
    """Return 1 where the recommended point's bad cases are better than the best observed one's, -1 if worse, else 0.

    Compared are what 95 % of the re-queries are better than, and the worst of them; the first that differs by more than
    `_NOTABLE` of the range of values that the run met decides.
    """
    observed, answer = report.observed, report.recommended
    for difference in (
        _better(report, answer.bad, observed.bad),
        _better(report, answer.worst, observed.worst),
    ):
        if abs(difference) > _notable(report):
            return 1 if difference > 0.0 else -1
    return 0


def _of_the_model(report: RunReport) -> Verdict:
    """Return the verdict where nothing was queried again: what the model expects."""
    highest, answer, off, said = report.observed, report.recommended, report.disturbance, _said(report)
    peak = f"{report.extreme} {'dip' if report.minimized else 'peak'}"
    expected = said(_expected(answer))
    measured = "" if report.risk.name == "mean" else f" {report.manner}"
    text = f"No re-queries with perturbed inputs were made: what happens when {off} is what the model expects."
    if len(report.candidates) == 1:
        headline = (
            f"The {report.extreme} trial is also the recommended one: {said(answer.quality)} when hit exactly; when "
            f"{off}, the model expects {expected}{measured}."
        )
        return Verdict(headline, text, False)
    headline = (
        f"The {peak} ({said(highest.quality)}) is not recommended: when {off}, the model expects "
        f"{said(_expected(highest))} of it{measured}, and {expected} of the recommended point."
    )
    where = f"Recommended is {coordinates(report, answer)} ({_trial_of(report, answer)}). {text}"
    return Verdict(headline, where, True)


def _expected(candidate: Candidate) -> float | None:
    """Return what the model expects a candidate to be worth by what was asked for."""
    return candidate.predicted_mean if candidate.predicted_worth is None else candidate.predicted_worth


def _sentence(report: RunReport, candidate: Candidate, subject: str) -> str:
    n, said = candidate.values.size, _said(report)
    text = (
        f"{subject} ({_trial(report, candidate)}) reached a {report.quality_name} of {said(candidate.quality)} when "
        f"hit exactly. Queried again {n} times with perturbed inputs it gave {said(candidate.mean)} on average "
        f"({_change(candidate)}), {said(candidate.worst)} at worst."
    )
    if report.risk.name not in ("mean", "worst"):
        text += f" The {report.risk.words(report.minimized)} of them is {said(candidate.worth)}."
    if halved(candidate):
        text += f" In {halved(candidate)} of {n} it lost more than half."
    if candidate.n_failed:
        text += f" {candidate.n_failed} further re-queries gave no value."
    return text


def _change(candidate: Candidate) -> str:
    return change(candidate) or f"{number(candidate.mean - candidate.quality)} from the exact value"


def _better(report: RunReport, one: float, other: float) -> float:
    """Return by how much one value is better than another."""
    return other - one if report.minimized else one - other


def _difference(report: RunReport) -> tuple[float, float]:
    """Return by how much the answer is better, and the standard error: paired where both were shaken alike.

    By the mean of the re-queries, or by the risk measure that was asked for; of that by a bootstrap (Efron 1979). Of
    the lowest re-query there is none: half of what counts as a notable difference.
    """
    highest, answer = report.observed, report.recommended
    gap = _better(report, answer.worth, highest.worth)
    a, h = answer.values, highest.values
    if report.risk.name == "worst":
        return gap, 0.5 * _notable(report)
    if report.risk.name != "mean":
        return gap, _bootstrapped(highest, answer)
    if a.size == h.size and a.size > 1 and answer.n_failed == highest.n_failed == 0:
        return gap, float(np.std(a - h, ddof=1)) / math.sqrt(a.size)
    return gap, math.hypot(answer.std / math.sqrt(a.size), highest.std / math.sqrt(h.size))


def _bootstrapped(one: Candidate, other: Candidate) -> float:
    """Return the standard error of the difference of two risk measures of re-queries, paired where shaken alike."""
    rng, gaps = np.random.default_rng(0), []
    alike = one.values.size == other.values.size and one.n_failed == other.n_failed == 0
    for _ in range(_RESAMPLES):
        first = rng.integers(one.values.size, size=one.values.size)
        second = first if alike else rng.integers(other.values.size, size=other.values.size)
        resampled = (replace(c, values=c.values[again]).worth for c, again in ((one, first), (other, second)))
        gaps.append(next(resampled) - next(resampled))
    return float(np.std(gaps, ddof=1))


def _trial(report: RunReport, candidate: Candidate) -> str:
    return "the model's choice" if candidate.trial is None else f"trial {report.numbers[candidate.trial]}"


def _trial_of(report: RunReport, candidate: Candidate) -> str:
    """Return which trial it was, and of how many: they are numbered from 0, or as in a study."""
    return f"{_trial(report, candidate)}, one of {report.y.size}"
