"""The perturbed re-queries of a run's points: announced where they take long, left out at Ctrl-C."""

import time
from collections.abc import Collection

from rich.console import Console

from surehold.optimization.maximization import Result
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.perturbation import RobustScore, robust_score
from surehold.problems.problem import Problem
from surehold.reports import gather

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
    return scores, gather.kept_in_box(scores, result)
