"""`surehold scene [OBJECT]`: browse objects, facets and modes in three dimensions."""

import json
import webbrowser
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from surehold.amounts import amount
from surehold.cli.grasp_options import object_of, shown_progress, takes_grasp_options
from surehold.cli.options import Open, Out

__all__ = ["scene"]

_COLUMNS = ("object", "mode", "standoff [mm]", "s1", "dx, dy [mm]", "status", "quality", "contacts", "start free")
_ALONG, _ACROSS = 9, 5  # grasps that are tried in a mode


_UNUSED = ("variables", "cloud", "camera", "normals", "contacts", "cloud_noise", "prior", "shapes", "plan")


@partial(takes_grasp_options, without=_UNUSED)
def scene(
    obj: Annotated[
        str, typer.Argument(metavar="[OBJECT]", help="mug, bottle, glass, drill, or a mesh file; all four by default.")
    ] = "",
    facet: Annotated[
        str, typer.Option(help="One mode such as right-front, one facet such as right, or all.", show_default=False)
    ] = "",
    out: Out = "",
    open_page: Open = False,
    **options: Any,
) -> None:
    """Browse objects, facets and modes: the best of 45 grasps in each, as a page, JSON and a picture."""
    from surehold.cli.compilation import announced
    from surehold.cli.folders import folder_of, removed_on_error
    from surehold.cli.terminal import terminal
    from surehold.grasping.object.shipped import OBJECTS
    from surehold.grasping.pictures.scene import grasp_scene
    from surehold.grasping.plain_data import grasp_to_dict
    from surehold.problems.grasp.default_poses import default_facet
    from surehold.problems.grasp.description import described_grasp, described_hand
    from surehold.problems.grasp.options import checked_words
    from surehold.reports.run_report import Candidate
    from surehold.reports.scene import drawn_scene
    from surehold.reports.scenes_page import render_scenes
    from surehold.reports.still import still_picture
    from surehold.store.atomic import write_file

    console = terminal()
    words = checked_words(options)
    gripper = described_hand(words["hand"], words["hand_config"])
    quick = words["hand"] == "icub-left" and not words["preshape"] and (not obj or obj in OBJECTS)
    if facet:
        _modes(facet)  # explains an unknown one at once
    folder = folder_of(out, f"scene-{Path(obj).stem or 'objects'}")
    with removed_on_error(folder):
        views, notes, rows, data = [], [], [], []
        best = -np.inf
        picture = None
        for name in [obj] if obj else OBJECTS:
            described = {**words, "object": name}
            body = object_of(described, console)
            for mode in _modes(facet or ("all" if quick else default_facet(body))):
                with announced(console), shown_progress(f"{body.name}, {mode}", console) as progress:
                    problem = described_grasp({**described, "facet": mode}, body, progress)
                x, outcome, free = _best(problem)
                drawn = drawn_scene(grasp_scene(problem.simulator, outcome))
                label = f"{body.name}, {mode}"
                views.append(Candidate(label, x, outcome.quality, scene=drawn))
                shares = f"{100.0 * free:.0f} % of {_ALONG * _ACROSS}"
                notes.append(
                    f"{label}: {outcome.status}, quality {outcome.quality:.3f} with "
                    f"{amount(len(outcome.contacts), 'contact')}; {shares} poses start free of collision."
                )
                default = problem.default
                place = f"{1e3 * x[0]:.0f}, {1e3 * x[1]:.0f}"
                rows.append(
                    (
                        body.name,
                        mode,
                        f"{1e3 * default.standoff:.1f}",
                        f"{default.s1:.2f}",
                        place,
                        outcome.status,
                        f"{outcome.quality:.3f}",
                        str(len(outcome.contacts)),
                        shares,
                    )
                )
                data.append(
                    {"object": body.name, "mode": mode, "default": default, "free": free, "x": x, "grasp": outcome}
                )
                if outcome.quality > best:
                    best, picture = outcome.quality, drawn
        text = (
            f"Hand {gripper.name}. Of each mode, the facet that the palm faces and the one at the thumb, the best of "
            f"{_ALONG * _ACROSS} grasps around the default pose. The slider closes the fingers."
        )
        page = render_scenes("Objects, facets and modes", text, views, notes, _COLUMNS, rows)
        write_file(folder / "scene.html", page)
        plain = grasp_to_dict({"hand": gripper.name, "grasps": data})
        write_file(folder / "scene.json", json.dumps(plain, indent=1, allow_nan=False) + "\n")
        drawn_by = "nothing"
        if picture is not None:
            png, drawn_by = still_picture(picture)
            write_file(folder / "scene.png", png)
        closed = sum(row[5] == "ok" for row in rows)
        console.print(
            f"{len(rows)} mode{'s' if len(rows) != 1 else ''}, {closed} with a grasp that closes; the best is worth "
            f"{best:.3f}. Picture by {drawn_by}. Page: {folder / 'scene.html'}",
            markup=False,
            soft_wrap=True,
        )
        if open_page:
            webbrowser.open((folder / "scene.html").resolve().as_uri())


def _modes(text: str) -> list[str]:
    """Return the modes that `--facet` names."""
    from surehold.grasping.poses import FACETS, MODES, facet_axes

    if text == "all":
        return list(MODES)
    if text in FACETS:
        return [mode for mode in MODES if mode.startswith(f"{text}-")]
    facet_axes(text)  # explains an unknown one
    return [text]


def _best(problem: Any) -> tuple[Any, Any, float]:
    """Return place and outcome of the best grasp of a grid over dx and dy, and the share that starts free."""
    u, v = ((2.0 * np.arange(n) + 1.0) / (2.0 * n) for n in (_ALONG, _ACROSS))
    points = problem.box.from_unit(np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2))
    outcomes = [problem.grasp(x) for x in points]
    first = int(np.argmax([outcome.quality for outcome in outcomes]))
    free = float(np.mean([outcome.status != "initial collision" for outcome in outcomes]))
    return points[first], outcomes[first], free
