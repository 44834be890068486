"""What runs cost: CPU seconds beside the original program's, and the total of a campaign."""

from collections.abc import Mapping

from surehold.campaigns.comparison import rows_of
from surehold.campaigns.published import ORIGINAL_SECONDS
from surehold.campaigns.table import Records
from surehold.reports.campaign_report import Table
from surehold.reports.wording import number

__all__ = ["cost_table", "total_cost_table"]


def cost_table(campaigns: Mapping[str, Records]) -> Table:
    """Return CPU seconds of our runs beside the original program's."""
    body = []
    for plan in ("table-4.1", "table-4.4"):
        for name in (plan, f"{plan}-defaults"):
            records = campaigns.get(name)
            if records is None:
                continue
            seen = set()
            for row in rows_of(records):
                original = ORIGINAL_SECONDS.get((row.problem, row.method))
                if row.ours is None or original is None or (row.problem, row.method) in seen:
                    continue
                seen.add((row.problem, row.method))
                settings = "defaults" if name.endswith("-defaults") else "thesis"
                body.append(
                    (
                        row.problem,
                        row.method,
                        settings,
                        number(row.seconds, 3),
                        number(original, 3),
                        number(original / row.seconds, 2),
                        number(row.seconds * row.planned / 3600.0, 2),
                        number(original * row.planned / 3600.0, 2),
                    )
                )
    head = ("problem", "method", "settings", "CPU s a run", "original", "ratio", "hours for all runs", "original")
    note = (
        "CPU seconds on one core, scoring under noise included. The original's were measured on a quieter machine, on "
        "which LAPACK's dpotrf of a 140 x 140 matrix takes 0.10 ms."
    )
    return Table("costs", "What a run costs", head, tuple(body), (), note)


def total_cost_table(campaigns: Mapping[str, Records]) -> Table:
    """Return what each campaign has cost, and what all its runs cost by the mean of those made."""
    body = []
    for plan, records in campaigns.items():
        cells = [(cell["problem"], cell["method"]) for cell in records.header["cells"]]
        seconds: dict[tuple[str, str], list[float]] = {}
        for (problem, method, _), row in records.done.items():
            if (problem, method) in cells:
                seconds.setdefault((problem, method), []).append(row["cpu_seconds"])
        planned = records.runs
        known = [sum(seconds[cell]) / len(seconds[cell]) for cell in cells if cell in seconds]
        body.append(
            (
                plan,
                f"{sum(map(len, seconds.values()))} of {planned * len(cells)}",
                number(sum(map(sum, seconds.values())) / 60.0, 3),
                number(sum(known) * planned / 60.0, 3) if len(known) == len(cells) else "–",
            )
        )
    head = ("campaign", "runs", "CPU minutes", "for all planned runs")
    note = "By the mean of the runs made, where every problem and method has one; two workers need half the time."
    return Table("total-costs", "What the campaigns cost", head, tuple(body), (), note)
