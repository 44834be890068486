"""The words that a report uses, explained to somebody who has read nothing else."""

from typing import Final

from surehold.reports.run_report import RunReport

__all__ = ["glossary"]

_QUALITIES: Final = {
    "epsilon": (
        "The weakest push or twist, over all directions, that the contacts can just resist while their normal forces "
        "sum to 1; twists are divided by half the object's longest side. Higher is better; 0 means that some push is "
        "not resisted at all. Grasps of the shipped objects reach about 0.2."
    ),
    "signed_epsilon": (
        "Epsilon, the weakest push or twist that the contacts resist while their normal forces sum to 1, continued "
        "below 0 by what is missing until every push is resisted: -0.05 log(1 + distance / 0.05)."
    ),
    "volume": "Volume of the set of pushes and twists that the contacts can resist together. Higher is better.",
    "simox": "Epsilon relative to that of forces everywhere on the object, as the simulator of the thesis has it.",
    "task": "The largest share of the task's pushes, by default gravity from all sides, that the contacts resist.",
    "closure": "1 where the contacts resist some force in every direction, else 0.",
    "min_weight": (
        "How evenly the contacts share the load where nothing pushes the object, from 0 to 1; 0 means that some push "
        "is not resisted at all."
    ),
    "balance": "How well the contacts take over six pushes along the object's axes, from 0 to 1.",
}
_INSIDE: Final = "the open hand overlapped the object there, so it could not close: deeper is lower."
#: Types of grasp of the iCub's hands, whose posture turns the thumb; a learned synergy has a name of its own.
_TURN_THE_THUMB: Final = ("power", "pinch", "tripod")


def glossary(report: RunReport) -> list[tuple[str, str]]:
    """Return the words of the page with their meaning, in the order in which they appear."""
    better = "lower" if report.minimized else "higher"
    words = [("trial", "One input that was tried. Trials are numbered from 0.")]
    if any(variable.drawn for variable in report.variables):
        words.append(("drawn", "A condition that nobody sets; shown is that of the trial."))
    if report.n_initial:
        words.append(("initial design", "Trials spread evenly over all inputs, before there is a model to choose by."))
    if report.counted:
        words.append(("success", "1 where a trial succeeded, 0 where it did not; the share of several executions."))
    else:
        words.append(("hit exactly", "The value of the trial itself, which reached its input."))
    if report.extreme.endswith("feasible") or (report.feasible is not None and not report.feasible.all()):
        meaning = "Fit to be the answer: allowed, inside of the box, within all limits, and not prone to fail."
        words.append(("feasible", meaning))
    if report.noise is not None:
        meaning = "How far an execution ends up from what is commanded: ± gives one standard deviation of a variable."
        words.append(("input noise", meaning))
    if any(candidate.values.size or candidate.n_failed for candidate in report.candidates):
        moved = "moved by the input noise" if report.noise is not None else "under conditions drawn anew"
        same = "They only score the two points, are the same moves for both, and are no part of the budget."
        words.append(("re-queries", f"The point tried again, each time {moved}. {same}"))
    words += [] if report.counted else _of_executions(report, better)
    if any(view.robust_mean is not None for view in report.surfaces):
        meaning = "The model's mean over where an execution may end up: there a good place is one that holds."
        words.append(("averaged over the input noise", meaning))
    quality, contact = str(report.settings.get("quality", "")), report.settings.get("contact")
    if quality in _QUALITIES and not report.counted:
        words.append((f"quality ({quality})", _QUALITIES[quality]))
        not_closed = "Some push is not resisted: the more is missing, the lower. Or the status is a collision: "
        words.append(("below 0", not_closed + _INSIDE if quality == "signed_epsilon" else _INSIDE.capitalize()))
    if report.quality_name.endswith(" shapes"):
        words.append(("over shapes", "Mean over equally likely shapes, all of which agree with what was measured."))
    if contact == "graded":
        words.append(
            ("graded contacts", "A soft touch: a point counts more the nearer it is to the skin, up to 6 mm away.")
        )
    if "s1" in [v.name for v in report.variables] or any("s1" in c.pose for c in report.candidates):
        words.append(("s1", _posture(report)))
    return words


def _posture(report: RunReport) -> str:
    """Return what the variable s1 does, which is the hand's own, or its synergy's."""
    hand, preshape = str(report.settings.get("hand", "")), report.settings.get("preshape")
    if hand.startswith("icub-") and preshape in _TURN_THE_THUMB:
        return "Posture of the hand along its first synergy; here it turns the thumb."
    return "Posture of the hand: how far it is moved along what its description, or its synergy file, says for s1."


def _of_executions(report: RunReport, better: str) -> list[tuple[str, str]]:
    """Return the words for what executions give, of those that are on the page."""
    words = []
    if any(candidate.values.size for candidate in report.candidates):
        meaning = f"{better.capitalize()} is better: one re-query in twenty is worse than this."
        words.append(("95 % of them are better than", meaning))
    if any(candidate.predicted_mean is not None for candidate in report.candidates):
        unsure = "Its uncertainty is what the model does not know yet; it shrinks with further trials."
        words.append(("mean under the noise", f"What many executions give on average. {unsure}"))
    words += _measure(report)
    if any(candidate.predicted_std is not None for candidate in report.candidates):
        meaning = "What the next execution gives. Its standard deviation holds the input noise, the noise of the "
        meaning += "measurement and the model's uncertainty; trials do not make it vanish."
        words.append(("one execution", meaning))
    return words


def _measure(report: RunReport) -> list[tuple[str, str]]:
    """Return the risk measure that was asked for, with its meaning; nothing where that is the mean."""
    if report.risk.name == "mean":
        return []
    extreme = "low" if report.minimized else "high"
    meaning = f"What was asked for in place of the mean: it should be as {extreme} as possible."
    if any(candidate.n_failed for candidate in report.candidates):
        meaning += " A re-query without a value counts as the worst value of the run."
    return [(report.risk.words(report.minimized), meaning)]
