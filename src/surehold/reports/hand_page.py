"""A hand on one page that opens without network: open and closed, its axes, its joints and what looks wrong with it."""

from collections.abc import Sequence

import numpy as np

from surehold.grasping.hand.model import CLOSED, Hand
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.pictures.hand import hand_scene
from surehold.reports.page import TEMPLATES, environment, scene_context
from surehold.reports.run_report import Candidate, Scene, SceneMesh

__all__ = ["JOINT_COLUMNS", "joint_rows", "render_hand"]

JOINT_COLUMNS = ("finger", "joint", "range", "open", "closed")
_PALM, _LINK, _ROD, _CENTER = "#9aa3ad", "#c3bdb2", "#3f4a57", "#f0b400"
_AXES = {"x": "#d1383d", "y": "#2f9e44", "z": "#2b6fdb"}
_VIEW = (0.75, -0.9, 0.75)


def joint_rows(hand: Hand, preshape: str) -> list[tuple[str, ...]]:
    """Return a row of `JOINT_COLUMNS` for each joint that moves: its range, and where it is open and closed."""
    motion = closing_motion(hand, 0.0, preshape)
    opened, closed = motion.joints(0.0), motion.joints(CLOSED)
    slides = hand.chains[:, :, 0] > 0.0
    rows = []
    for i, joint in enumerate(hand.joint_names):
        if not joint:
            continue
        place = divmod(i, hand.lower.shape[1])
        lower, upper, start, end = (_value(a[place], slides[place]) for a in (hand.lower, hand.upper, opened, closed))
        unit = "mm" if slides[place] else "rad"
        rests = np.isclose(opened[place], closed[place], atol=1e-6)
        rows.append(
            (hand.finger_names[place[0]], joint, f"{lower} to {upper} {unit}", start, "rests" if rests else end)
        )
    return rows


def render_hand(hand: Hand, facts: Sequence[tuple[str, str]], faults: Sequence[str]) -> str:
    """Return the page as HTML text: each preshape open and closing, `facts` (name, value) and what looks wrong.

    Raises
    ------
    InputError
        If a scene is malformed or all of them together are too large.
    """
    from markupsafe import Markup

    from surehold import __version__

    views, notes = [], []
    for name in hand.preshapes:
        for opened in (True, False):
            state = "open" if opened else "closed"
            label = state if len(hand.preshapes) == 1 else f"{name}, {state}"
            views.append(Candidate(label, np.empty(0), 0.0, scene=_scene(hand, name, opened)))
            rest = "at rest before it closes" if opened else "the slider opens and closes it; here nothing stops it"
            notes.append(f"{hand.name}, {name}: {rest}.")
    return (
        environment()
        .get_template("hand.html.j2")
        .render(
            title=f"Hand {hand.name}",
            version=__version__,
            css=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),
            faults=list(faults),
            facts=list(facts),
            axes=_AXES,
            center=_CENTER,
            rod=_ROD,
            columns=JOINT_COLUMNS,
            tables={name: joint_rows(hand, name) for name in hand.preshapes},
            **scene_context(views, notes, first=1),
        )
    )


def _scene(hand: Hand, preshape: str, opened: bool) -> Scene:
    drawn = hand_scene(hand, preshape, opened)
    colored = [(mesh, _PALM if mesh.name == "palm" else _LINK) for mesh in drawn.bodies]
    colored += [(mesh, _AXES[mesh.name]) for mesh in drawn.axes]
    colored += [(mesh, _ROD) for mesh in drawn.joints]
    colored.append((drawn.grasp_center, _CENTER))
    bodies = len(drawn.bodies)
    meshes = [
        SceneMesh(mesh.name, mesh.vertices, mesh.faces, color, see_through=i < bodies, poses=mesh.poses)
        for i, (mesh, color) in enumerate(colored)
    ]
    return Scene(tuple(meshes), view=_VIEW)


def _value(value: float, slides: bool) -> str:
    return f"{1e3 * value:.1f}" if slides else f"{value + 0.0:.2f}"
