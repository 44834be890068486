"""One run of a campaign: ask, try, tell, score the answer under noise, and keep the traces.

Traces are stored as the iterations at which they change, `[[0, 1.2], [7, 3.4], ...]`: best values and answers stay the
same for long. Numbers have nine significant digits.
"""

import hashlib
import platform
from collections.abc import Sequence
from contextlib import chdir
from functools import cache
from importlib import metadata
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.methods import Method, build_method
from surehold.campaigns.plan import Cell
from surehold.campaigns.problem_setup import build_problem, noise_of, observer, robust_problem_of
from surehold.optimization.numerics.threads import single_threaded
from surehold.optimization.strategy.initial_design import design
from surehold.problems.perturbation import robust_score
from surehold.store.uninterrupted import raise_interruption

__all__ = ["TIMES", "changes", "expanded", "run_once", "versions"]

#: Fields of a row that differ from one execution of the same run to the next.
TIMES: Final = ("ask_seconds", "cpu_seconds", "seconds")
_ROBUST: Final = ("mean", "worst", "std")


def run_once(cell: Cell, seed: int) -> dict[str, Any]:
    """Make one run and return its row, JSON-ready; an error becomes the row of a failed run.

    Fields of a finished run, traces as changes by iteration: `best` (highest value told), `value` (true value of the
    answer, where it is another), `mean`, `worst`, `std` (of the answer re-queried under the input noise; a re-query
    that gives no value counts as the lowest of the run, `failed_requeries` is their number at the end), `regret`
    (under the own noise of a robust problem), `leaves` (of the tree); `first_split` (trials told when the tree first
    split, or null), `x` (the answer, unit cube), `expectation` (its exact mean under the noise, where that is known),
    `failed_trials`, `ask_seconds` (CPU, a trial).
    """
    row: dict[str, Any] = {"problem": cell.problem, "method": cell.method, "seed": seed, "digest": cell.digest}
    started, cpu = perf_counter(), process_time()
    try:
        with single_threaded(), chdir("."):  # a function may go to another folder, and the next run begins here
            row |= {"status": "done", **_Run(cell, seed).finish()}
    except Exception as error:
        raise_interruption(error)
        row |= {"status": "failed", "error": f"{type(error).__name__}: {error}"}
    row |= {"cpu_seconds": round(process_time() - cpu, 3), "seconds": round(perf_counter() - started, 3)}
    return row | {"settings": cell.as_data(), "versions": versions()}


class _Run:
    """The state of one run."""

    def __init__(self, cell: Cell, seed: int):
        self.cell, self.seed = cell, seed
        self.problem = build_problem(cell.on)
        d = self.problem.box.dimension
        initial = design("latin_hypercube", cell.on.initial, d, np.random.default_rng([seed, 0]))
        self.method: Method = build_method(cell, d, initial, seed)
        self.observe = observer(self.problem, cell.on, seed)
        self.noise = noise_of(cell.on)
        self.asked = robust_problem_of(cell.on)
        self.X: list[NDArray[np.float64]] = []
        self.told: list[float] = []
        self.failure = ""  # of the first trial that raised
        self.true: list[float] = []
        self.answers: list[NDArray[np.float64] | None] = []
        self.leaves: list[float] = []
        self.ask_seconds: list[float] = []
        self._scores: dict[bytes, tuple[float, float, float]] = {}
        self._without_value: dict[bytes, int] = {}
        self._regrets: dict[bytes, float] = {}

    def finish(self) -> dict[str, Any]:
        for t in range(self.cell.on.trials):
            started = process_time()
            u = np.clip(np.asarray(self.method.ask(), dtype=np.float64), 0.0, 1.0)
            self.ask_seconds.append(process_time() - started)
            if t > 0:  # after asking: the model is conditioned once, on the clock
                self._look()
            self._try(u)
        self._look()
        return self._row()

    def _try(self, u: NDArray[np.float64]) -> None:
        try:
            told, true = self.observe(u)
        except Exception as error:  # a trial that gives nothing is the trial's outcome, not the run's end
            told = true = np.nan
            self.failure = self.failure or f"{type(error).__name__}: {error}"
        self.X.append(u)
        self.told.append(told if np.isfinite(told) else np.nan)
        self.true.append(true if np.isfinite(told) else np.nan)
        if np.isfinite(told) or self.cell.by.optimizer == "surehold":
            self.method.tell(u, self.told[-1])
        else:  # other libraries hear of the lowest value so far, as ours does inside
            finite = [y for y in self.told if np.isfinite(y)]
            self.method.tell(u, min(finite, default=0.0))

    def _look(self) -> None:
        """Note what the method would answer after the trials told so far, and the size of its tree."""
        t = len(self.X)
        values = np.array(self.told)
        if not np.isfinite(values).any():
            self.answers.append(None)
            self.leaves.append(1)
            return
        started = t >= self.cell.on.initial
        self.answers.append(self.method.answer() if started else self.X[int(np.nanargmax(values))])
        self.leaves.append(getattr(self.method, "leaves", 1) if started and self._treed else 1)

    @property
    def _treed(self) -> bool:
        return self.cell.as_data()["settings"].get("surrogate") == "tgp"

    def _score(self, u: NDArray[np.float64] | None) -> tuple[float, float, float]:
        if u is None or self.noise is None:
            return np.nan, np.nan, np.nan
        key = u.tobytes()
        if key not in self._scores:
            x = self.problem.box.from_unit(u)
            score = robust_score(self.problem, x, self.noise, self.cell.on.requeries, self.seed)
            self._without_value[key] = score.n_failed
            self._scores[key] = (score.mean, score.worst, score.std)
            if score.n_failed:  # leaving them out would praise an answer for failing where its values are low
                values = np.append(score.values, np.full(score.n_failed, np.nanmin(self.true)))
                self._scores[key] = float(values.mean()), float(values.min()), float(values.std(ddof=1))
        return self._scores[key]

    def _regret(self, u: NDArray[np.float64] | None) -> float:
        """Return what the answer's outcome under the problem's own noise lacks to the best one."""
        if u is None or self.asked is None or self.asked.optimum is None:
            return np.nan
        key = u.tobytes()
        if key not in self._regrets:
            value = self.asked.value(self.problem.box.from_unit(u)[None])[0]
            self._regrets[key] = self.asked.optimum.value - float(value)
        return self._regrets[key]

    def _value(self, u: NDArray[np.float64] | None) -> float:
        if u is None:
            return np.nan
        same = [i for i, x in enumerate(self.X) if np.array_equal(x, u)]
        return self.true[same[0]] if same else float(self.problem(self.problem.box.from_unit(u)))

    def _row(self) -> dict[str, Any]:
        told = np.array(self.told)
        if not np.isfinite(told).any():
            first = self.failure or "it gave no finite number"
            raise ValueError(f"all {len(told)} trials failed; the first: {first}")
        best = np.maximum.accumulate(np.where(np.isfinite(told), told, -np.inf))
        scores = np.array([self._score(u) for u in self.answers])
        split = [t + 1 for t, leaves in enumerate(self.leaves) if leaves > 1]
        answer = self.answers[-1]
        row: dict[str, Any] = {
            "trials": len(told),
            "initial": self.cell.on.initial,
            "best": changes(np.where(np.isfinite(best), best, np.nan)),
        }
        value = changes([self._value(u) for u in self.answers])
        if value != row["best"]:
            row["value"] = value
        if self.noise is not None:
            row |= {name: changes(scores[:, i]) for i, name in enumerate(_ROBUST)}
            if answer is not None and (lost := self._without_value[answer.tobytes()]):
                row["failed_requeries"] = lost
        if self.asked is not None:
            row["regret"] = changes([self._regret(u) for u in self.answers])
        if self._treed:
            row |= {"leaves": changes(self.leaves), "first_split": split[0] if split else None}
        expectation = getattr(self.problem, "expectation", None)
        exact = None
        if expectation is not None and self.noise is not None and answer is not None:
            exact = _nine(float(expectation(self.problem.box.from_unit(answer), self.noise)))
        return row | {
            "x": None if answer is None else [_nine(v) for v in answer],
            "expectation": exact,
            "failed_trials": int(np.sum(~np.isfinite(told))),
            "ask_seconds": [float(f"{s:.3g}") for s in self.ask_seconds],
        }


def changes(trace: Sequence[float] | NDArray[np.float64]) -> list[list[float | None]]:
    """Return [iteration, value] wherever a trace changes; a missing value (NaN) is null.

    Examples
    --------
    >>> changes([1.0, 1.0, 2.0])
    [[0, 1.0], [2, 2.0]]
    """
    rounded = [None if np.isnan(v) else _nine(v) for v in trace]
    return [[t, v] for t, v in enumerate(rounded) if t == 0 or v != rounded[t - 1]]


def expanded(steps: Sequence[Sequence[float | None]], length: int) -> NDArray[np.float64]:
    """Return the trace (length,) from its changes.

    Examples
    --------
    >>> expanded([[0, 1.0], [2, 2.0]], 4)
    array([1., 1., 2., 2.])
    """
    trace = np.full(length, np.nan)
    for t, value in steps:
        trace[int(t or 0) :] = np.nan if value is None else value
    return trace


@cache
def versions() -> dict[str, str]:
    """Return the versions that a row is stamped with; `source` is a fingerprint of the package's own files."""
    import surehold

    names = ("numpy", "scipy", "numba")
    root = Path(surehold.__file__).parent
    digest = hashlib.sha256()
    for floor in ("optimization", "grasping", "problems", "campaigns"):
        for path in sorted((root / floor).rglob("*.py")):
            digest.update(path.read_bytes())
    return {
        "surehold": surehold.__version__,
        "source": digest.hexdigest()[:8],
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in names},
    }


def _nine(value: float) -> float:
    return float(f"{value:.9g}")
