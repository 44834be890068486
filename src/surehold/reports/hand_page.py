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
_PALM, _LINK, _ROD, _CENTER = "#9aa3ad", "#c3bdb2", "#8e5bd0", "#f0b400"
_AXES = {"x": "#d1383d", "y": "#2f9e44", "z": "#2b6fdb"}
_VIEW, _YAW = (0.0, -1.0, 0.7), np.radians(-40.0)  # from the front and above; the hands are turned about z


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
    """Return the page as HTML text: the open hand beside the closing one, `facts` (name, value), and what looks wrong.

    Raises
    ------
    InputError
        If a scene is malformed or all of them together are too large.
    """
    from markupsafe import Markup

    from surehold import __version__

    views = [Candidate(name, np.empty(0), 0.0, scene=_scene(hand, name)) for name in hand.preshapes]
    notes = [
        f"{hand.name}, {name}: open on the left; on the right as the slider says, while nothing stops it."
        for name in hand.preshapes
    ]
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
            **scene_context(views, notes, first=0),
        )
    )


def _scene(hand: Hand, preshape: str) -> Scene:
    """Return the open hand on the left and the closing one on the right of the picture, each seen at an angle."""
    opened, closing = hand_scene(hand, preshape, opened=True), hand_scene(hand, preshape)
    turn = np.array([[np.cos(_YAW), -np.sin(_YAW), 0.0], [np.sin(_YAW), np.cos(_YAW), 0.0], [0.0, 0.0, 1.0]])
    across = np.concatenate(
        [mesh.vertices @ (turn[0] @ mesh.poses[0, :, :3]) + turn[0] @ mesh.poses[0, :, 3] for mesh in opened.bodies]
    )
    meshes = []
    for drawn, side in ((opened, -0.5), (closing, 0.5)):
        shift = np.array([1.2 * side * float(np.ptp(across)), 0.0, 0.0])
        colored = [(mesh, _PALM if mesh.name == "palm" else _LINK) for mesh in drawn.bodies]
        colored += [(mesh, _AXES[mesh.name]) for mesh in drawn.axes]
        colored += [(mesh, _ROD) for mesh in drawn.joints]
        colored.append((drawn.grasp_center, _CENTER))
        for mesh, color in colored:
            poses = turn @ mesh.poses
            poses[:, :, 3] += shift
            meshes.append(SceneMesh(mesh.name, mesh.vertices, mesh.faces, color, mesh.name == "palm", poses))
    return Scene(tuple(meshes), view=_VIEW)


def _value(value: float, slides: bool) -> str:
    return f"{round(1e3 * value, 1) + 0.0:.1f}" if slides else f"{round(value, 2) + 0.0:.2f}"
