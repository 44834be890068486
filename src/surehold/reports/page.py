"""One run as one HTML file that opens without network: text, pictures and the 3-D scene are all inside."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.reports import figures
from surehold.reports.drawing import marked
from surehold.reports.glossary import glossary
from surehold.reports.run_report import Candidate, RunReport, Scene, Surface, Variable
from surehold.reports.scene import scene_data
from surehold.reports.trial_rows import trial_rows
from surehold.reports.verdict import verdict
from surehold.reports.wording import change, coordinate, coordinates, halved, number, percent, setting, worth

__all__ = ["TEMPLATES", "environment", "render", "scene_context", "table_rows"]

TEMPLATES: Final = Path(__file__).parent / "templates"


def render(report: RunReport, drawings: Mapping[str, str] | None = None) -> str:
    """Return the page of a run as HTML text.

    Parameters
    ----------
    report
        The run.
    drawings
        Its figures as `figures.svg_text` by name, if they have been drawn already.

    Raises
    ------
    InputError
        If a scene of the report is malformed or too large.
    """
    from markupsafe import Markup

    from surehold import __version__

    told = verdict(report)
    if drawings is None:
        drawings = {name: figures.svg_text(figure, name) for name, figure in figures.figures(report).items()}
    shown = [c for c in report.candidates if c.scene is not None]
    trials = trial_rows(report)
    hover = _hover(report, trials)
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            report=report,
            verdict=told,
            version=__version__,
            css=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),
            n_initial=min(report.n_initial, report.y.size),
            n_failed=int(report.failed.sum()),
            noise_text=_noise_text(report),
            two=len(report.candidates) > 1,
            heading=_heading,
            cards=[_card(report, c, told.refused, drawings) for c in report.candidates],
            maps=[_map(report, i, drawings, trials) for i in range(len(report.surfaces))],
            trace=Markup(figures.inline_svg(drawings["trace"], "trace", "Best and robust value by trial", hover)),
            figure_script=Markup((TEMPLATES / "figures.js").read_text(encoding="utf-8")),
            rows=table_rows(report),
            words=glossary(report),
            settings=[("seed", report.seed), *((k, setting(v)) for k, v in report.settings.items() if k != "seed")],
            trials=trials,
            **scene_context(shown, [_scene_note(report, c) for c in shown], [_label(report, c) for c in shown]),
        )
    )


def environment() -> Any:
    """Return what renders the templates: everything escaped, nothing undefined."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def scene_context(
    shown: Sequence[Candidate],
    notes: Sequence[str] = (),
    labels: Sequence[Mapping[str, str]] = (),
    first: int | None = None,
) -> dict[str, Any]:
    """Return what the templates of the 3-D scene need: one view, button and note for each candidate.

    The page opens with the candidate number `first`, the last one by default.
    """
    from markupsafe import Markup

    scene = scene_data(tuple(shown))
    opening = len(shown) - 1 if first is None else first
    if scene is not None:
        scene["first"] = opening
        for i, (view, candidate) in enumerate(zip(scene["views"], shown, strict=True)):
            view["note"] = notes[i] if notes else f"{candidate.label}."
    return {
        "scene": None if scene is None else Markup(_json_for_html(scene)),
        "scene_labels": list(labels) or [{"role": "answer", "mark": "", "text": c.label} for c in shown],
        "scene_first": opening,
        "scene_moves": any(_moves(c.scene) for c in shown if c.scene is not None),
        "scene_legend": next((c.scene.legend for c in shown if c.scene is not None and c.scene.legend), ""),
        "scene_has_contacts": any(c.scene is not None and c.scene.contacts is not None for c in shown),
        "scene_has_neighbors": any(c.scene is not None and c.scene.neighbors is not None for c in shown),
        "scene_has_box": any(c.scene is not None and c.scene.box is not None for c in shown),
        "three": Markup("" if scene is None else _vendored("three.bundle.min.js")),
        "scene_script": Markup((TEMPLATES / "scene.js").read_text(encoding="utf-8")),
    }


def _moves(scene: Scene) -> bool:
    return any(mesh.poses is not None and len(mesh.poses) > 1 for mesh in scene.meshes)


def _json_for_html(data: Any) -> str:
    """Return JSON that cannot end the `<script>` it stands in."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _vendored(name: str) -> str:
    return (TEMPLATES / "vendor" / name).read_text(encoding="utf-8")


def _label(report: RunReport, candidate: Candidate) -> dict[str, str]:
    alone = len(report.candidates) == 1
    role = "high" if candidate is report.observed and not alone else "answer"
    role = role if report.succeeded else "high"
    text = report.called(candidate)
    text = text[0].upper() + text[1:]
    return {"role": role, "mark": "▲" if role == "high" else "●", "text": text}


def _card(report: RunReport, candidate: Candidate, refused: bool, drawings: Mapping[str, str]) -> dict[str, Any]:
    from markupsafe import Markup

    label = _label(report, candidate)
    shaken = candidate.values.size > 0
    tag = ""
    if refused and shaken:
        tag = "refused" if label["role"] == "high" else "holds better"
    svg = None
    if shaken and not report.counted:
        what = f"the {candidate.label} point" if report.succeeded else report.called(candidate)
        name = f"shake-{label['role']}"
        text = (
            f"Histogram of {candidate.values.size} re-queries of {what}: {report.risk.words(report.minimized)} "
            f"{worth(report, candidate.worth)}, worst {worth(report, candidate.worst)}"
        )
        svg = Markup(figures.inline_svg(drawings[figures.shake_name(candidate)], name, text))
    return {
        **label,
        "title": label["text"],
        "tag": tag,
        "tag_class": "no" if tag == "refused" else "yes",
        "where": coordinates(report, candidate),
        "quality": percent(candidate.predicted_mean) if report.counted else worth(report, candidate.quality),
        "quality_is": "of executions are expected to succeed" if report.counted else "hit exactly",
        "mean": "" if not shaken else percent(candidate.mean) if report.counted else worth(report, candidate.worth),
        "mean_is": f"of {candidate.values.size} re-queries succeeded" if report.counted else report.manner,
        "worst": worth(report, candidate.worst),
        "std": number(candidate.std, 2),
        "n": candidate.values.size + candidate.n_failed,
        "halved": halved(candidate),
        "change": change(candidate) if shaken and not report.counted and report.risk.name == "mean" else "",
        "svg": svg,
    }


def _scene_note(report: RunReport, candidate: Candidate) -> str:
    name = candidate.label if report.succeeded else report.called(candidate)
    parts = [f"{name[0].upper()}{name[1:]}: {worth(report, candidate.quality)} when hit exactly"]
    if candidate.values.size:
        parts.append(
            f"{worth(report, candidate.mean)} on average and {worth(report, candidate.worst)} at worst when off"
        )
    if candidate.scene is not None and candidate.scene.contacts is not None:
        n = len(candidate.scene.contacts.points)
        parts.append(f"{n} contact{'' if n == 1 else 's'}")
    if candidate.status:
        parts.append(f"status {candidate.status}")
    return ", ".join(parts) + "."


def _noise_text(report: RunReport) -> str:
    if report.noise is None:
        return ""
    deviations = np.sqrt(np.diag(report.noise))
    shown = [_deviation(v, float(s)) for v, s in zip(report.variables, deviations, strict=True)]
    if len(shown) > 4:
        shares = deviations / np.array([v.upper - v.lower for v in report.variables])
        if np.allclose(shares, shares[0]):
            return f"± {number(100.0 * float(shares[0]), 2)} % of each range"
    return ", ".join(shown)


def _deviation(variable: Variable, deviation: float) -> str:
    if variable.log:  # of the logarithm, which has no unit
        return f"ln {variable.name} ± {number(deviation, 2)}"
    space = "" if variable.shown_unit in ("", "°") else " "
    return f"{variable.name} ± {number(deviation * variable.factor, 2)}{space}{variable.shown_unit}"


def _hover(report: RunReport, trials: list[dict[str, Any]], view: Surface | None = None) -> dict[str, list[str]]:
    """Return what is said beside the pointer over each mark of a trial, by group of marks."""
    names, told = [*map(_heading, report.variables), *report.choices], []
    for trial in trials:
        places = [f"{name} {value}" for name, value in zip(names, [*trial["x"], *trial["choices"]], strict=True)]
        told.append("\n".join([f"trial {trial['number']}: {report.quality_name} {trial['y']}", *places]))
    return {group: [told[i] for i in np.flatnonzero(which)] for group, which in marked(report, view).items()}


def _map(report: RunReport, index: int, drawings: Mapping[str, str], trials: list[dict[str, Any]]) -> dict[str, Any]:
    from markupsafe import Markup

    view = report.surfaces[index]
    names = " and ".join(report.variables[i].name for i in view.variables)
    hover, pictures = _hover(report, trials, view), []
    for robust, name in figures.surface_names(report, index).items():
        text = f"{'Average over the input noise' if robust else 'Mean'} of the model over {names}, with the trials"
        pictures.append(Markup(figures.inline_svg(drawings[name], name, text, hover)))
    return {"note": view.note, "is_map": len(view.variables) == 2, "ring": _ring(report, view), "svgs": pictures}


def _ring(report: RunReport, view: Surface) -> str:
    """Return what is drawn around the candidates of a map; how much lies within is known of normal noise only."""
    if report.noise is None:
        return ""
    widths = np.array([report.variables[i].upper - report.variables[i].lower for i in view.variables])
    unit = report.noise[np.ix_(view.variables, view.variables)] / np.outer(widths, widths)  # a farad, a hertz
    held = np.linalg.matrix_rank(unit, hermitian=True)
    what = {0: "", 1: "line: two standard deviations of the input noise to each side"}
    share = {1: 95, 2: 86}  # erf(sqrt(2)), and 1 - exp(-2)
    text = what.get(int(held), "ring: two standard deviations of the input noise")
    within = f", where about {share.get(int(held), 0)} % of imprecise executions end up"
    return text + within * bool(text and report.normal_noise)


def table_rows(report: RunReport) -> list[tuple[str, list[str]]]:
    """Return what is known of the candidates, line by line: the name and one cell for each candidate."""
    every = report.candidates

    def row(name: str, cell: Any) -> tuple[str, list[str]]:
        return name, [cell(c) for c in every]

    rows = [row(_heading(v), lambda c, i=i, v=v: coordinate(v, c.x[i], 4)) for i, v in enumerate(report.variables)]
    for name, texts in report.choices.items():
        rows.append(row(name, lambda c, texts=texts: "–" if c.trial is None else texts[c.trial]))
    if any(c.pose for c in every):
        rows.append(row("pose", lambda c: c.pose or "–"))
    if any(c.status for c in every):
        rows.append(row("status", lambda c: c.status or "–"))
    numbers = report.numbers
    rows.append(row("trial, from 0", lambda c: "–" if c.trial is None else str(numbers[c.trial])))
    if report.counted:
        rows.append(row("share of the trial that succeeded", lambda c: number(c.quality, 4)))
        if any(c.values.size for c in every):
            rows.append(row("share of perturbed re-queries that succeeded", lambda c: number(c.mean, 4)))
    else:
        rows.append(row(f"{report.quality_name}, hit exactly", lambda c: worth(report, c.quality, 4)))
    if any(c.values.size for c in every) and not report.counted:
        n, failed = max(c.values.size + c.n_failed for c in every), any(c.n_failed for c in every)
        those = "those perturbed re-queries that gave a value" if failed else f"{n} perturbed re-queries"
        rows.append(row(f"mean of {those}", lambda c: worth(report, c.mean, 4)))
        if report.risk.name not in ("mean", "worst"):
            rows.append(row(f"{report.risk.words(report.minimized)} of them", lambda c: worth(report, c.worth, 4)))
        if report.risk != Risk("var", alpha=0.05):  # which is the same but for how the quantile is interpolated
            rows.append(row("95 % of them are better than", lambda c: worth(report, c.bad, 4)))
        rows.append(row("worst of them", lambda c: worth(report, c.worst, 4)))
        rows.append(row("standard deviation", lambda c: number(c.std, 3)))
        if failed:
            rows.append(row(f"re-queries without a value, of {n}", lambda c: str(c.n_failed)))
    if any(c.predicted_mean is not None for c in every):
        what = "share of executions that succeeds" if report.counted else "mean under the noise"
        rows.append(row(f"model: {what} ± its uncertainty", lambda c: _expected(report, c, c.predicted_error)))
    if any(c.predicted_mean is not None for c in every) and not report.counted:
        rows.append(row("model: one execution ± standard deviation", lambda c: _expected(report, c, c.predicted_std)))
    if any(c.predicted_worth is not None for c in every):
        measure = f"model: {report.risk.words(report.minimized)}"
        rows.append(row(measure, lambda c: worth(report, c.predicted_worth, 4)))
    names = dict.fromkeys(name for c in every for name in c.details)
    rows.extend(row(name, lambda c, name=name: c.details.get(name, "–")) for name in names)
    return rows


def _expected(report: RunReport, candidate: Candidate, deviation: float | None) -> str:
    if candidate.predicted_mean is None or deviation is None:
        return "–"
    return f"{worth(report, candidate.predicted_mean, 4)} ± {number(deviation, 2)}"


def _heading(variable: Variable) -> str:
    return f"{variable.label}{' (drawn)' * variable.drawn}"
