"""Our runs beside the published numbers and beside each other: rows, verdicts, paired tests, claims."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.published import Published, published
from surehold.campaigns.single_run import expanded
from surehold.campaigns.statistics import LEVEL, Paired, Summary, holm, p_against, paired, summary
from surehold.campaigns.table import Records
from surehold.campaigns.thesis import CLAIMS, Claim, exhibit_of
from surehold.problems.synthetic import SYNTHETIC, synthetic_function
from surehold.reports.wording import number

__all__ = ["ClaimResult", "Comparison", "Row", "claim_results", "comparisons", "final_values", "measures_of", "rows_of"]

#: Measures that are better when they are low.
LOWER: Final = ("std", "regret")
_FEW: Final = 20  # common seeds below which a missing difference says little
#: Smallest effect of interest: differences of means below this share of a problem's scale (`least_of`) are no verdict,
#: however many seeds show them. Half of the 1 % within which a run counts as having found the maximum.
SMALLEST_EFFECT: Final = 0.005
LABELS: Final = {
    "best": "best observed value",
    "mean": "mean under input noise",
    "worst": "worst of the re-queries",
    "std": "standard deviation of the re-queries",
    "regret": "regret under input noise",
}


@dataclass(frozen=True)
class Row:
    """One problem, method and measure: our runs, and the published number where there is one."""

    problem: str
    method: str
    measure: str
    planned: int
    failed: int
    ours: Summary | None
    """None while no run is finished"""
    theirs: Published | None
    p: float
    """of equal means, Holm-adjusted within the table; NaN where nothing is compared"""
    verdict: str
    """"agrees", "better", "differs", or empty"""
    seconds: float
    """mean CPU seconds of a run; NaN without runs"""
    ask_seconds: float
    """mean CPU seconds of asking for a trial after the initial design; NaN without runs"""


@dataclass(frozen=True)
class Comparison:
    """Two methods on common seeds."""

    problem: str
    measure: str
    method: str
    reference: str
    difference: Paired
    """method - reference"""
    p: float
    """Holm-adjusted within the campaign"""
    verdict: str
    """"better", "worse", "no difference of interest" (below `SMALLEST_EFFECT`) or "no difference shown" """


@dataclass(frozen=True)
class ClaimResult:
    """A claim of the thesis and what the runs say."""

    claim: Claim
    plan: str
    result: Paired | None
    p: float
    """Holm-adjusted within the table"""
    verdict: str
    """"holds", "not shown", "contradicted", "too few runs" or "no runs" """
    reason: str
    """why a claim does not hold, where that is seen; else empty"""


def measures_of(records: Records) -> tuple[str, ...]:
    """Return the measures by which a campaign compares: the thesis' table's, or robust ones where there is noise."""
    exhibit = exhibit_of(records.header["plan"])
    if exhibit is not None:
        return exhibit.measures
    noises = [cell["input_noise"] for cell in records.header["cells"]]
    if noises and all(noise == "own" for noise in noises):
        return ("regret", "mean")
    noisy = any(noise is not None for noise in noises)
    return ("mean", "worst", "std") if noisy else ("best",)


def final_values(records: Records, problem: str, method: str, measure: str) -> dict[int, float]:
    """Return what the finished runs ended with, by seed."""
    found = {}
    for (p, m, seed), row in records.done.items():
        if (p, m) == (problem, method) and measure in row:
            value = row[measure][-1][1]
            if value is not None:
                found[seed] = float(value)
    return dict(sorted(found.items()))


def traces(records: Records, problem: str, method: str, measure: str) -> NDArray[np.float64]:
    """Return the traces of the finished runs (n, trials)."""
    rows = [row for (p, m, _), row in sorted(records.done.items()) if (p, m) == (problem, method) and measure in row]
    return np.array([expanded(row[measure], row["trials"]) for row in rows])


def rows_of(records: Records) -> list[Row]:
    """Return the rows of a campaign's table, with verdicts beside the published numbers."""
    exhibit = exhibit_of(records.header["plan"])
    rows = []
    for measure in measures_of(records):
        for cell in records.header["cells"]:
            problem, method = cell["problem"], cell["method"]
            values = list(final_values(records, problem, method, measure).values())
            theirs = None if exhibit is None else published(exhibit.table, problem, method, measure)
            own = [row for (p, m, _), row in records.done.items() if (p, m) == (problem, method)]
            lost = sum((p, m) == (problem, method) for p, m, _ in records.failed)
            p = math.nan
            if values and theirs is not None:
                p = p_against(values, theirs.mean, theirs.std, theirs.runs)
            rows.append(
                Row(
                    problem,
                    method,
                    measure,
                    records.runs,
                    lost,
                    summary(values) if values else None,
                    theirs,
                    p,
                    "",
                    float(np.mean([row["cpu_seconds"] for row in own])) if own else math.nan,
                    float(np.mean([s for row in own for s in row["ask_seconds"][row["initial"] :]] or [math.nan])),
                )
            )
    adjusted = _holm_where([row.p for row in rows])
    return [_judged(row, p, least_of(records, row.problem)) for row, p in zip(rows, adjusted, strict=True)]


def comparisons(records: Records) -> list[Comparison]:
    """Return every method beside the plan's first one, on common seeds; Holm over all of them."""
    methods = list(dict.fromkeys(cell["method"] for cell in records.header["cells"]))
    problems = list(dict.fromkeys(cell["problem"] for cell in records.header["cells"]))
    found = []
    for measure in measures_of(records):
        for problem in problems:
            for method in methods[1:]:
                difference = _difference(records, problem, method, methods[0], measure)
                if difference is not None:
                    found.append((problem, measure, method, difference))
    adjusted = holm([difference.p for *_, difference in found])
    return [
        Comparison(
            problem,
            measure,
            method,
            methods[0],
            difference,
            p,
            _word(difference, p, measure, least_of(records, problem)),
        )
        for (problem, measure, method, difference), p in zip(found, adjusted, strict=True)
    ]


def claim_results(campaigns: Mapping[str, Records]) -> list[ClaimResult]:
    """Return what the campaigns (by plan) say of the thesis' claims; Holm within each plan."""
    results = []
    for plan in dict.fromkeys(c.plan for c in CLAIMS):
        for name in (plan, f"{plan}-defaults"):
            claims = [claim for claim in CLAIMS if claim.plan == plan]
            records = campaigns.get(name)
            told = [
                None if records is None else _difference(records, c.problem, c.better, c.than, c.measure)
                for c in claims
            ]
            adjusted = _holm_where([math.nan if t is None else t.p for t in told])
            results += [
                ClaimResult(
                    claim, name, t, p, word := _claim_word(records, claim, t, p), _reason(records, claim, t, word)
                )
                for claim, t, p in zip(claims, told, adjusted, strict=True)
            ]
    return results


def _difference(records: Records, problem: str, method: str, reference: str, measure: str) -> Paired | None:
    ours = final_values(records, problem, method, measure)
    theirs = final_values(records, problem, reference, measure)
    common = [seed for seed in ours if seed in theirs]
    if len(common) < 2:
        return None
    return paired([ours[seed] for seed in common], [theirs[seed] for seed in common])


def least_of(records: Records, problem: str) -> float:
    """Return the smallest difference of interest on a problem, in its outcomes' units.

    `SMALLEST_EFFECT` of the known maximum of a synthetic function; elsewhere, of the highest mean that any method of
    the campaign reached (of the best observed value, or of the first measure where that is not recorded).
    """
    cells = [cell for cell in records.header["cells"] if cell["problem"] == problem]
    if cells[0]["function"] in SYNTHETIC:
        return SMALLEST_EFFECT * abs(synthetic_function(cells[0]["function"]).optimum.value)
    for measure in ("best", *measures_of(records)):
        values = [list(final_values(records, problem, cell["method"], measure).values()) for cell in cells]
        if any(values):
            return SMALLEST_EFFECT * abs(max(float(np.mean(v)) for v in values if v))
    return 0.0


def _word(difference: Paired, p: float, measure: str, least: float) -> str:
    if not p < LEVEL or difference.r * difference.mean <= 0.0:  # most seeds gain, but a few lose more than that, or
        return "no difference shown"  # the other way round: ranks and mean do not say the same
    if abs(difference.mean) < least:
        return "no difference of interest"
    return "better" if (difference.r > 0.0) != (measure in LOWER) else "worse"


def _claim_word(records: Records | None, claim: Claim, difference: Paired | None, p: float) -> str:
    if records is None or difference is None:
        return "no runs"
    word = _word(difference, p, claim.measure, least_of(records, claim.problem))
    if word == "no difference shown" and difference.n < _FEW:
        return "too few runs"
    if claim.expected == "no better":
        return "contradicted" if word == "better" else "holds"
    return {"better": "holds", "worse": "contradicted"}.get(word, "not shown")


def _reason(records: Records | None, claim: Claim, difference: Paired | None, word: str) -> str:
    if records is None or difference is None or word not in ("not shown", "contradicted"):
        return ""
    least = least_of(records, claim.problem)
    if 0.0 < abs(difference.mean) < least:
        small = f"the difference is below the smallest of interest, {number(least, 2)}"
        return "; ".join(filter(None, (_seen(records, claim, difference, word), small)))
    return _seen(records, claim, difference, word)


def _seen(records: Records, claim: Claim, difference: Paired, word: str) -> str:
    function = next(cell["function"] for cell in records.header["cells"] if cell["problem"] == claim.problem)
    if claim.measure == "best" and function in SYNTHETIC:
        return _near_the_maximum(records, claim, function)
    return _beside_the_printed(records, claim, difference, word)


def _near_the_maximum(records: Records, claim: Claim, function: str) -> str:
    enough = 0.99 * synthetic_function(function).optimum.value
    counts = []
    for method in (claim.than, claim.better):
        values = final_values(records, claim.problem, method, "best").values()
        counts.append(f"{sum(value >= enough for value in values)} of {len(values)}")
    return f"within 1 % of the maximum end {counts[0]} runs of {claim.than} and {counts[1]} of {claim.better}"


def _beside_the_printed(records: Records, claim: Claim, difference: Paired, word: str) -> str:
    first, second = (final_values(records, claim.problem, m, claim.measure) for m in (claim.better, claim.than))
    same = sum(value == second.get(seed) for seed, value in first.items())
    parts = [f"both give the same answer on {same} of {difference.n} seeds"] if same else []
    exhibit = exhibit_of(claim.plan)
    printed = [
        None if exhibit is None else published(exhibit.table, claim.problem, m, claim.measure)
        for m in (claim.better, claim.than)
    ]
    if printed[0] is not None and printed[1] is not None and difference.se > 0.0:
        gap = printed[0].mean - printed[1].mean
        parts.append(
            f"printed is a difference of {number(gap, 2)}, {abs(gap) / difference.se:.1f} of our standard errors"
        )
        own = sum(second.values()) / len(second)
        parts.append(f"{claim.than} alone ends with {number(own, 2)} here, {number(printed[1].mean, 2)} in print")
    if word == "not shown" and difference.mean != 0.0:
        if (difference.mean > 0.0) == (claim.measure in LOWER):
            parts.append("ours has the other sign")
        else:
            parts.append(f"about {_seeds_needed(difference)} seeds would show ours")
    return "; ".join(parts)


def _seeds_needed(difference: Paired) -> int:
    """Return with how many seeds a difference of this size is found, unadjusted, in four cases of five."""
    from scipy.stats import norm

    z = float(norm.ppf(1.0 - LEVEL / 2.0) + norm.ppf(0.8))
    return math.ceil(difference.n * (z * difference.se / difference.mean) ** 2)


def _judged(row: Row, p: float, least: float) -> Row:
    verdict = ""
    if row.ours is not None and row.theirs is not None:
        gap = row.ours.mean - row.theirs.mean
        rounded = abs(gap) <= 0.5 * row.theirs.unit
        if rounded or p >= LEVEL or abs(gap) < least:
            verdict = "agrees"
        elif math.isnan(p):
            verdict = ""
        else:
            verdict = "better" if (gap > 0.0) != (row.measure in LOWER) else "differs"
    return replace(row, p=p, verdict=verdict)


def _holm_where(p: Iterable[float]) -> list[float]:
    """Return adjusted p-values; NaN stays and does not count."""
    values = list(p)
    places = [i for i, value in enumerate(values) if not math.isnan(value)]
    for i, adjusted in zip(places, holm([values[i] for i in places]), strict=True):
        values[i] = adjusted
    return values
