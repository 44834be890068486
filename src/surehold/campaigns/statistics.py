"""Statistics of runs: summaries, paired differences on common seeds, corrections, comparison with published numbers.

Legend
    values   results of runs, one a seed
    se       standard error of the mean, s / sqrt(n)
    low, high   bounds of the 95 % bootstrap interval of a mean (percentiles of 2000 resamples, always the same ones)
    r        matched-pairs rank-biserial correlation, -1 to 1: (sum of ranks of positive differences - of negative ones)
             / sum of all ranks (Kerby 2014)
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError

__all__ = ["LEVEL", "Paired", "Summary", "bootstrap_interval", "holm", "p_against", "paired", "summary"]

LEVEL: Final = 0.05
_RESAMPLES: Final = 2000
_FEW: Final = 50  # differences up to which the distribution of their ranks is computed


class Summary(NamedTuple):
    """Results of the runs of one problem and method."""

    n: int
    mean: float
    se: float
    """NaN for a single run"""
    std: float
    """over runs, divisor n - 1"""
    median: float
    low: float
    high: float


class Paired(NamedTuple):
    """Difference of two methods on common seeds."""

    n: int
    """common seeds"""
    mean: float
    """mean difference, first - second"""
    se: float
    low: float
    high: float
    p: float
    """of Wilcoxon's signed-rank test, two-sided, exact up to 50 differences; 1 where all are 0"""
    r: float
    """effect size, see the legend"""


def summary(values: ArrayLike) -> Summary:
    """Summarize the results (n,) of runs.

    Raises
    ------
    InputError
        If there is none, or one is not finite.
    """
    x = _checked(values)
    n = x.size
    std = float(x.std(ddof=1)) if n > 1 else math.nan
    low, high = bootstrap_interval(x)
    return Summary(n, float(x.mean()), std / math.sqrt(n), std, float(np.median(x)), low, high)


def bootstrap_interval(values: ArrayLike, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile bootstrap interval of the mean of values (n,), Efron 1979."""
    x = _checked(values)
    rng = np.random.default_rng(0)
    means = x[rng.integers(0, x.size, (_RESAMPLES, x.size))].mean(axis=1)
    low, high = np.quantile(means, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return float(low), float(high)


def paired(first: ArrayLike, second: ArrayLike) -> Paired:
    """Compare two methods run by run; both (n,) in the order of the seeds.

    Raises
    ------
    InputError
        If they have different lengths, or a value is not finite.
    """
    from scipy.stats import rankdata, wilcoxon

    a, b = _checked(first), _checked(second)
    if a.size != b.size:
        raise InputError(f"paired values have the lengths {a.size} and {b.size}; give the results of common seeds.")
    difference = a - b
    low, high = bootstrap_interval(difference)
    se = float(difference.std(ddof=1)) / math.sqrt(a.size) if a.size > 1 else math.nan
    other = difference[difference != 0.0]
    p, r = 1.0, 0.0
    if other.size:
        ranks = rankdata(np.abs(other))
        few = other.size <= _FEW
        p = _exact_p(other, ranks) if few else float(wilcoxon(other, method="asymptotic")[1])  # pyright: ignore
        r = float(np.sign(other) @ ranks / ranks.sum())
    return Paired(a.size, float(difference.mean()), se, low, high, p, r)


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number, Holm 1979, in the order given."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    highest = 0.0
    for rank, i in enumerate(order):
        highest = max(highest, min(1.0, (len(p) - rank) * p[i]))
        adjusted[i] = highest
    return adjusted.tolist()


def p_against(values: ArrayLike, mean: float, std: float | None, n: int) -> float:
    """Return the p-value of our values (n_o,) having the mean of n published runs (Welch's test, two-sided).

    `std` is the published standard deviation over runs; None takes ours for it. NaN for fewer than two runs.
    """
    from scipy.stats import ttest_ind_from_stats

    x = _checked(values)
    if x.size < 2 or n < 2:
        return math.nan
    own = float(x.std(ddof=1))
    other = own if std is None else std
    if own == 0.0 and other == 0.0:
        return 1.0 if x.mean() == mean else 0.0
    return float(ttest_ind_from_stats(x.mean(), own, x.size, mean, other, n, equal_var=False).pvalue)


def _exact_p(other: NDArray[np.float64], ranks: NDArray[np.float64]) -> float:
    """Return the two-sided p-value of signed ranks by their exact distribution: each sign as likely as the other.

    Differences of the same size share a mean rank. Of four equal ones the normal approximation says p = 0.046; all
    their signs agree in one of eight cases.
    """
    twice = np.rint(2.0 * ranks).astype(np.int64)
    chances = np.ones(1)  # of each sum of the positive ones
    for rank in twice:
        chances = 0.5 * (np.pad(chances, (0, rank)) + np.pad(chances, (rank, 0)))
    up = int(twice[other > 0.0].sum())
    return min(1.0, 2.0 * min(float(chances[: up + 1].sum()), float(chances[up:].sum())))


def _checked(values: ArrayLike) -> NDArray[np.float64]:
    x = np.asarray(values, dtype=np.float64).reshape(-1)
    if x.size == 0:
        raise InputError("there are no runs to summarize; run the campaign first.")
    if not np.isfinite(x).all():
        raise InputError(f"{int(np.sum(~np.isfinite(x)))} of {x.size} values are not finite; leave failed runs out.")
    return x
