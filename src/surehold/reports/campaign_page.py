"""Campaigns as one HTML file that opens without network, as CSVs, and as Markdown."""

import csv
import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from surehold.reports import figures
from surehold.reports.campaign_report import CampaignReport, Table
from surehold.reports.page import TEMPLATES, environment, scene_context
from surehold.reports.run_report import Candidate
from surehold.store.csv_cells import written_cell

__all__ = ["csv_text", "markdown_table", "render_campaigns"]


def render_campaigns(report: CampaignReport, drawings: Mapping[str, str]) -> str:
    """Return the page as HTML text; `drawings` are the pictures as `figures.svg_text` by name.

    Raises
    ------
    InputError
        If a scene of the report is malformed or too large.
    """
    from markupsafe import Markup

    from surehold import __version__

    pictures = {
        picture.name: Markup(figures.inline_svg(drawings[picture.name], picture.name, picture.title))
        for section in report.sections
        for picture in section.pictures
    }
    return (
        environment()
        .get_template("campaign.html.j2")
        .render(
            report=report,
            version=__version__,
            css=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),
            pictures=pictures,
            **scene_context([_view(label, scene) for label, scene in report.scenes.items()]),
        )
    )


def csv_text(table: Table) -> str:
    """Return a table as CSV."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([written_cell(cell) for cell in row] for row in (table.head, *table.rows))
    return buffer.getvalue()


def markdown_table(table: Table) -> str:
    """Return a table as Markdown."""

    def line(cells: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"

    return "\n".join([line(table.head), "|" + "---|" * len(table.head), *(line(row) for row in table.rows)])


def _view(label: str, scene: Any) -> Candidate:
    return Candidate(label, np.zeros(1), float("nan"), scene=scene)
