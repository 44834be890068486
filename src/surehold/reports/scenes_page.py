"""Many grasps to browse on one page that opens without network: objects, facets, modes."""

from collections.abc import Sequence

from surehold.reports.page import TEMPLATES, environment, scene_context
from surehold.reports.run_report import Candidate

__all__ = ["render_scenes"]


def render_scenes(
    title: str,
    text: str,
    candidates: Sequence[Candidate],
    notes: Sequence[str],
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    heading: str = "All of them",
) -> str:
    """Return the page as HTML text: a view for each candidate, the one of highest quality first, and a headed table.

    Raises
    ------
    InputError
        If a scene is malformed or all of them together are too large.
    """
    from markupsafe import Markup

    from surehold import __version__

    return (
        environment()
        .get_template("scenes.html.j2")
        .render(
            title=title,
            text=text,
            version=__version__,
            css=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),
            columns=columns,
            rows=rows,
            heading=heading,
            **scene_context(candidates, notes, first=max(range(len(candidates)), key=lambda i: candidates[i].quality)),
        )
    )
