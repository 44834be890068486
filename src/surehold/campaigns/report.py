"""The report of campaigns: one page, a CSV a table and the figures, from the tables in given folders."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from surehold.amounts import amount
from surehold.campaigns.comparison import claim_results
from surehold.campaigns.costs import cost_table, total_cost_table
from surehold.campaigns.illustrations import grasp_scenes, illustrations
from surehold.campaigns.plan import ProblemSetup
from surehold.campaigns.problem_setup import build_problem, noise_of
from surehold.campaigns.sections import (
    campaign_section,
    claims_table,
    open_places_table,
    plus_minus_remark,
)
from surehold.campaigns.table import Records, read_folder
from surehold.campaigns.thesis import exhibit_of
from surehold.errors import InputError
from surehold.reports.campaign_report import CampaignReport, Section
from surehold.store.atomic import checked_folder, write_file

__all__ = ["campaign_report", "read_campaigns", "write_report"]


def read_campaigns(folders: Sequence[str | Path]) -> dict[str, Records]:
    """Return the tables of folders by plan, the thesis' first and in its order.

    Raises
    ------
    InputError
        If a folder holds no table, or two hold the same plan.
    """
    found: dict[str, Records] = {}
    for folder in folders:
        records = read_folder(folder)
        if records.header["plan"] in found:
            raise InputError(f"two folders hold runs of the plan '{records.header['plan']}'; give one of them.")
        found[records.header["plan"]] = records
    return dict(sorted(found.items(), key=lambda item: (exhibit_of(item[0]) is None, item[0])))


def write_report(
    folders: Sequence[str | Path],
    out: str | Path,
    *,
    illustrations: bool = True,
    say: Callable[[str], Any] = lambda text: None,
) -> Path:
    """Write campaigns.html, tables/*.csv and figures/*.svg, *.png into the folder `out`; return the path of the page.

    Raises
    ------
    InputError
        If a table cannot be read or the folder not be written.
    """
    from surehold.reports import figures
    from surehold.reports.campaign_figures import draw_picture
    from surehold.reports.campaign_page import csv_text, render_campaigns

    path = checked_folder(out)
    report = campaign_report(read_campaigns(folders), illustrated=illustrations)
    pictures = checked_folder(path / "figures")
    tables = checked_folder(path / "tables")
    drawings = {}
    for section in report.sections:
        for picture in section.pictures:
            say(f"drawing {picture.name}")
            figure = draw_picture(picture)
            drawings[picture.name] = figures.svg_text(figure, picture.name)
            write_file(pictures / f"{picture.name}.svg", figures.on_white(drawings[picture.name]))
            write_file(pictures / f"{picture.name}.png", figures.png_bytes(figure))
        for table in section.tables:
            write_file(tables / f"{table.name}.csv", csv_text(table))
    write_file(path / "campaigns.html", render_campaigns(report, drawings))
    return path / "campaigns.html"


def campaign_report(campaigns: dict[str, Records], *, illustrated: bool = True) -> CampaignReport:
    """Return what the page of these campaigns shows."""
    thesis = any(exhibit_of(plan) is not None for plan in campaigns)
    sections = [campaign_section(records) for records in campaigns.values()]
    if thesis:
        first = Section("The thesis' claims", plus_minus_remark(campaigns), (claims_table(campaigns),))
        single = cost_table(campaigns)
        costs = (total_cost_table(campaigns), *([single] if single.rows else []))
        sections = [first, *sections, Section("Costs", "", costs), Section("Open places", "", (open_places_table(),))]
    scenes = {}
    if thesis and illustrated:
        sections.append(Section("Figures that need no runs", "", (), tuple(illustrations())))
        scenes = grasp_scenes(_bottle_answers(campaigns))
    runs = sum(_shown(records, records.done) for records in campaigns.values())
    planned = sum(len(records.cells) * records.runs for records in campaigns.values())
    failed = sum(_shown(records, records.failed) for records in campaigns.values())
    facts = [
        (f"{runs:,}", f"of {planned:,} planned runs"),
        (str(len(campaigns)), "campaign" if len(campaigns) == 1 else "campaigns"),
    ]
    if failed:
        facts.append((str(failed), "failed run" if failed == 1 else "failed runs"))
    notes = [note for records in campaigns.values() for note in (*records.notes, *_told_besides(records))]
    sources = {row["versions"]["source"] for records in campaigns.values() for row in records.done.values()}
    if len(sources) > 1:
        notes.append(
            f"The runs were made by {len(sources)} states of the source; every row of the tables names its own."
        )
    return CampaignReport("Campaigns", _headline(campaigns), tuple(facts), tuple(sections), scenes, tuple(notes))


def _shown(records: Records, rows: Mapping[tuple[str, str, int], Any]) -> int:
    """Return how many of the rows are of problems and methods that the plan has."""
    cells = records.cells
    return sum((problem, method) in cells for problem, method, _ in rows)


def _told_besides(records: Records) -> list[str]:
    """Return what the tables of a campaign cannot show."""
    title, notes = records.header["title"], []
    left = len(records.rows) - _shown(records, records.rows)
    if left:
        notes.append(f"{title}: {amount(left, 'run')} of problems or methods that the plan no longer has; not shown.")
    lost = [row["failed_requeries"] for row in records.done.values() if "failed_requeries" in row]
    if lost:
        notes.append(
            f"{title}: the answers of {amount(len(lost), 'run')} gave no value in some re-queries ({max(lost)} at "
            "most); each of these counts as the lowest value that its run met."
        )
    return notes


def _headline(campaigns: dict[str, Records]) -> str:
    told = [r for r in claim_results(campaigns) if r.verdict not in ("no runs", "too few runs")]
    if not told:
        runs = sum(_shown(records, records.done) for records in campaigns.values())
        return f"{amount(len(campaigns), 'campaign')}, {amount(runs, 'run')}."
    count = {word: sum(result.verdict == word for result in told) for word in ("holds", "not shown", "contradicted")}
    return (
        f"Of {len(told)} tests of the thesis' claims {count['holds']} hold, {count['not shown']} are not shown and "
        f"{count['contradicted']} are contradicted."
    )


def _bottle_answers(campaigns: dict[str, Records]) -> dict[str, tuple[list[float], list[float]]]:
    """Return what BO and UBO answered for the bottle, of the seed where BO's answer suffered most, and their worst."""
    from surehold.problems.perturbation import robust_score

    records = campaigns.get("table-4.4-grasps")
    if records is None:
        return {}
    rows = {(m, seed): row for (p, m, seed), row in records.done.items() if p == "bottle"}
    seeds = [seed for m, seed in rows if m == "BO" and ("UBO", seed) in rows]
    if not seeds:
        return {}
    seed = max(seeds, key=lambda s: rows["BO", s]["std"][-1][1] - rows["UBO", s]["std"][-1][1])
    told = rows["BO", seed]["settings"]
    on = ProblemSetup(**{name: told[name] for name in ("function", "arguments", "trials", "initial", "input_noise")})
    problem, noise = build_problem(on), noise_of(on)
    assert noise is not None
    found = {}
    for label, method in (("safe zone (UBO)", "UBO"), ("unsafe zone (BO)", "BO")):
        u = rows[method, seed]["x"]
        score = robust_score(problem, problem.box.from_unit(np.clip(u, 0.0, 1.0)), noise, told["requeries"], seed)
        worst = problem.box.to_unit(score.points[int(np.argmin(score.values))])
        found[label] = (u, worst.tolist())
    return found
