"""The perturbed re-queries of a run's points: announced where they take long, left out at Ctrl-C."""

import time
from collections.abc import Collection, Mapping

import numpy as np
from rich.console import Console

from surehold.optimization.maximization import Result
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.recommendation import MANY_OUTSIDE
from surehold.problems.perturbation import RobustScore, robust_score
from surehold.problems.problem import Problem

__all__ = ["requeried"]

_SOON = 2.0  # seconds of silence


def requeried(
    problem: Problem,
    result: Result,
    noise: InputNoise,
    n: int,
    seed: int,
    answers: Collection[tuple[str, int]],
    console: Console,
) -> tuple[dict[tuple[str, int], RobustScore | None], list[str]]:
    """Return the score of each of the answers (label, trial), None where there is none, and notes on what is missing.

    The problem is queried n times around each of them.
    """
    scores: dict[tuple[str, int], RobustScore | None] = dict.fromkeys(answers)
    started, done, said = time.perf_counter(), 0, False

    def told(_: float) -> None:
        nonlocal done, said
        done += 1
        if not said and time.perf_counter() - started > _SOON:
            said = True
            console.print(
                f"Re-querying {' and '.join(f'the {label} point' for label, _ in answers)} {n} times with the noise: "
                f"{done} of {n * len(scores)} done. "
                "Ctrl-C leaves the rest out; --requeries sets the number, 0 for none."
            )

    for label, index in scores:
        try:
            scores[label, index] = robust_score(problem, result.X[index], noise, n, seed, told)
        except KeyboardInterrupt:
            return scores, [f"The re-queries of the {label} point were interrupted and left out."]
    return scores, _held(scores, result)


def _held(scores: Mapping[tuple[str, int], RobustScore | None], result: Result) -> list[str]:
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
