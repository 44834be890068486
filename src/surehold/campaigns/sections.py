"""From tables of runs to what a page shows: published numbers beside ours, curves, claims and tests."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from surehold.campaigns.comparison import (
    LABELS,
    SMALLEST_EFFECT,
    Comparison,
    Row,
    claim_results,
    comparisons,
    measures_of,
    rows_of,
    traces,
)
from surehold.campaigns.table import Records
from surehold.campaigns.thesis import OPEN_PLACES, exhibit_of
from surehold.reports.campaign_report import Band, Line, Mark, Panel, Picture, Section, Table
from surehold.reports.wording import number

__all__ = [
    "campaign_section",
    "claims_table",
    "curves",
    "open_places_table",
    "plus_minus_remark",
]

#: The thesis' colors: black GP, blue w1, green w2, red w3, magenta w_inf; then further ones.
_COLORS: Final = ("#1b1f25", "#0a65b3", "#2e8b57", "#c24e00", "#b03ab0", "#8a6d00", "#00838f", "#795548")
_MARKS: Final[dict[str, Mark]] = {
    "agrees": "good",
    "better": "good",
    "differs": "bad",
    "holds": "good",
    "contradicted": "bad",
    "worse": "bad",
    "not shown": "open",
    "no difference shown": "open",
    "no difference of interest": "open",
    "too few runs": "open",
    "no runs": "open",
    "": "",
}


def campaign_section(records: Records) -> Section:
    """Return the part of the page that shows one campaign."""
    rows = rows_of(records)
    tables = [_result_table(records, rows)]
    tests = comparisons(records)
    if tests:
        tables.append(_test_table(records, tests))
    return Section(records.header["title"], records.header["note"], tuple(tables), tuple(curves(records)))


def curves(records: Records) -> list[Picture]:
    """Return the campaign's curves: mean over runs by trial, with a shaded band; the thesis' figures in its form."""
    plan = records.header["plan"]
    exhibit = exhibit_of(plan)
    if exhibit is None:
        problems = list(dict.fromkeys(cell["problem"] for cell in records.header["cells"]))
        wanted = {"curves": tuple((problem, m) for m in measures_of(records) if m != "worst" for problem in problems)}
        band = 1.96
    else:
        wanted, band = exhibit.figures, exhibit.band
    pictures = []
    for figure, places in wanted.items():
        panels = tuple(
            panel for problem, measure in places if (panel := _curve_panel(records, problem, measure, band)) is not None
        )
        if not panels:
            continue
        variant = "defaults" if plan.endswith("-defaults") else "thesis settings"
        title = f"Figure {figure}, {variant}" if exhibit else "Means over the runs"
        caption = (
            f"Mean over the runs by trial; band: ± {band:g} standard errors of the mean; gray: initial design."
            + (" Dashed red: median of the first split of the tree." if any(p.verticals for p in panels) else "")
        )
        pictures.append(Picture(f"{plan}-figure-{figure}" if exhibit else f"{plan}-curves", title, panels, caption))
    return pictures


def _curve_panel(records: Records, problem: str, measure: str, band: float) -> Panel | None:
    lines, bands, splits = [], [], []
    cells = [cell for cell in records.header["cells"] if cell["problem"] == problem]
    for i, cell in enumerate(cells):
        values = traces(records, problem, cell["method"], measure)
        if not len(values):
            continue
        trial = np.arange(1, values.shape[1] + 1)
        present = np.isfinite(values).all(axis=0)
        mean = values[:, present].mean(axis=0)
        color = _COLORS[i % len(_COLORS)]
        lines.append(Line(trial[present], mean, cell["method"], color))
        if len(values) > 1:
            half = band * values[:, present].std(axis=0, ddof=1) / math.sqrt(len(values))
            bands.append(Band(trial[present], mean - half, mean + half, color))
        splits += [
            row["first_split"]
            for (p, m, _), row in records.done.items()
            if (p, m) == (problem, cell["method"]) and row.get("first_split")
        ]
    if not lines:
        return None
    verticals = ((float(np.median(splits)), "first split"),) if splits else ()
    return Panel(
        problem, "trials", LABELS[measure], tuple(lines), tuple(bands), (), verticals, float(cells[0]["initial"])
    )


def _result_table(records: Records, rows: list[Row]) -> Table:
    exhibit = exhibit_of(records.header["plan"])
    head = ["problem", "method", "runs", "mean ± se", "median", "95 % bootstrap", "CPU s a run", "CPU s an ask"]
    several = len({row.measure for row in rows}) > 1
    if several:
        head.insert(2, "measure")
    if exhibit is not None:
        head += ["published", "p", "verdict"]
    body, marks = [], []
    for row in rows:
        runs = f"{0 if row.ours is None else row.ours.n} of {row.planned}"
        runs += f", {row.failed} failed" if row.failed else ""
        cells = [row.problem, row.method, *([LABELS[row.measure]] if several else []), runs]
        if row.ours is None:
            cells += ["–"] * 5
        else:
            own = row.ours
            cells += [
                f"{number(own.mean, 5)} ± {number(own.se, 2)}",
                number(own.median, 5),
                f"{number(own.low, 5)} to {number(own.high, 5)}",
                number(row.seconds, 2),
                number(row.ask_seconds, 2),
            ]
        if exhibit is not None:
            theirs = row.theirs
            shown = "–" if theirs is None else f"{theirs.mean:g}"
            if theirs is not None and theirs.pm is not None:
                shown += f" ± {theirs.pm:g}"
            cells += [
                shown,
                "–" if math.isnan(row.p) else _p(row.p),
                row.verdict or ("no runs" if row.ours is None else "–"),
            ]
        body.append(tuple(cells))
        marks.append(_MARKS[row.verdict] if exhibit is not None else "")
    note = (
        "p: Welch's test against the published mean, its ± read as 90 % half-width (where none is printed, our scatter "
        "is taken for theirs), Holm-adjusted within the table. Agrees: p ≥ 0.05 or equal as printed."
        if exhibit is not None
        else ""
    )
    title = f"Table {exhibit.table}" if exhibit is not None else "Results"
    return Table(f"{records.header['plan']}", title, tuple(head), tuple(body), tuple(marks), note)


def _test_table(records: Records, tests: list[Comparison]) -> Table:
    several = len({test.measure for test in tests}) > 1
    reference = tests[0].reference
    head = ["problem", "method", "common seeds", "difference ± se", "95 % bootstrap", "r", "p", "verdict"]
    if several:
        head.insert(2, "measure")
    body, marks = [], []
    for test in tests:
        d = test.difference
        body.append(
            (
                test.problem,
                test.method,
                *([LABELS[test.measure]] if several else []),
                str(d.n),
                f"{number(d.mean, 3)} ± {number(d.se, 2)}",
                f"{number(d.low, 3)} to {number(d.high, 3)}",
                f"{d.r:+.2f}".replace("-", "−"),
                _p(test.p),
                test.verdict,
            )
        )
        marks.append(_MARKS[test.verdict])
    note = (
        f"Difference: the method's value minus that of '{reference}'. Wilcoxon's signed-rank test on common seeds, "
        "Holm-adjusted; r: matched-pairs rank-biserial correlation."
    )
    return Table(
        f"{records.header['plan']}-tests",
        f"Beside {reference}, on common seeds",
        tuple(head),
        tuple(body),
        tuple(marks),
        note,
    )


def claims_table(campaigns: Mapping[str, Records]) -> Table:
    """Return the thesis' claims with what our runs say of them."""
    body, marks = [], []
    for told in claim_results(campaigns):
        if told.plan not in campaigns:
            continue
        d = told.result
        settings = "defaults" if told.plan.endswith("-defaults") else "thesis"
        body.append(
            (
                told.claim.text,
                settings,
                "0" if d is None else str(d.n),
                "–" if d is None else f"{number(d.mean, 3)} ± {number(d.se, 2)}",
                "–" if d is None or math.isnan(told.p) else _p(told.p),
                told.reason,
                told.verdict,
            )
        )
        marks.append(_MARKS[told.verdict])
    head = ("claim of the thesis", "settings", "common seeds", "difference ± se", "p", "what is seen", "verdict")
    note = (
        "Wilcoxon's signed-rank test on common seeds, Holm-adjusted within a table of the thesis. A claim of no gain "
        f"holds unless a gain is shown by 20 seeds or more. Differences below {100.0 * SMALLEST_EFFECT:g} % of the "
        "known maximum (of grasps: of the highest mean) are no gain and no loss, however sure they are."
    )
    return Table("claims", "The thesis' claims", head, tuple(body), tuple(marks), note)


def open_places_table() -> Table:
    """Return where the thesis leaves something open, and what is chosen here."""
    return Table(
        "open-places",
        "Where the thesis leaves something open",
        ("place", "the thesis", "chosen"),
        tuple(tuple(place) for place in OPEN_PLACES),
    )


def plus_minus_remark(campaigns: Mapping[str, Records]) -> str:
    """Return what the thesis' ± appears to be, by our own reruns where there are any."""
    ratios = []
    for plan in ("table-4.1", "table-4.3"):
        records = campaigns.get(plan)
        for row in [] if records is None else rows_of(records):
            if row.ours is not None and row.ours.n >= 20 and row.theirs is not None and row.theirs.pm:
                ratios.append(row.ours.std / row.theirs.pm)
    text = (
        "The thesis calls its ± a standard deviation over all runs. It appears to be the half-width of a 90 % "
        "confidence interval of the mean, 1.66 standard errors: a standard deviation over 100 runs would be 6.02 times "
        "the printed number."
    )
    if ratios:
        text += (
            f" In our reruns with the thesis' settings the standard deviation over runs is {np.median(ratios):.1f} "
            f"times the printed ± (median of {len(ratios)} rows)."
        )
    return text


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"{value:.3f}"
