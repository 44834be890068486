"""Options that say what is grasped and with which hand, and how they are read."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from surehold.errors import InputError

__all__ = [
    "Closing",
    "Friction",
    "HandConfigFile",
    "HandName",
    "MeshFrame",
    "MeshMass",
    "MeshUnit",
    "ObjectName",
    "PreshapeName",
    "hand_of",
    "object_of",
    "shown_progress",
]

ObjectName = Annotated[
    str, typer.Argument(metavar="OBJECT", help="mug, bottle, glass, drill, or a mesh file (STL, OBJ, PLY, glTF, GLB).")
]
MeshUnit = Annotated[str, typer.Option(help="Unit of a mesh file: mm, cm, m or in.", show_default=False)]
MeshMass = Annotated[float | None, typer.Option(help="Mass of a mesh [kg]; by default that of water.")]
MeshFrame = Annotated[
    str | None,
    typer.Option(help="Axes of a mesh's box: file, principal, or auto (the smaller).", show_default=False),
]
Friction = Annotated[float | None, typer.Option(help="Coefficient of friction; by default the object's own.")]
HandName = Annotated[
    str, typer.Option(help="icub-left, icub-right, shadow, panda, or a model file (.xml of MuJoCo, .urdf).")
]
HandConfigFile = Annotated[
    str, typer.Option(help="YAML description of a hand's model file: palm, fingers, preshapes.", show_default=False)
]
PreshapeName = Annotated[
    str, typer.Option(help="Type of grasp: power, tripod or pinch for the iCub.", show_default=False)
]
Closing = Annotated[
    str, typer.Option(help="adaptive: links beyond a touching one go on; synergy: a touch stops the finger.")
]


def object_of(name: str, unit: str, mass: float | None, frame: str | None, console: Console) -> Any:
    """Return the object of that name, or the mesh of that file with its diagnosis said and its distances computed.

    Raises
    ------
    InputError
        If the file is refused, or options of a mesh are given for a shipped object.
    """
    from surehold.grasping.object.shipped import OBJECTS, shipped_object

    if name in OBJECTS or not (Path(name).suffix or Path(name).exists()):
        options = {"--unit": unit or None, "--mass": mass, "--frame": frame}
        given = [option for option, value in options.items() if value is not None]
        if name in OBJECTS and given:
            raise InputError(f"{given[0]} is for mesh files; '{name}' is shipped with its own size and mass.")
        return shipped_object(name)
    from surehold.grasping.object.distance_field import distance_field_of
    from surehold.grasping.object.mesh_files import load_mesh

    loaded = load_mesh(name, unit or None, mass, frame or "auto")
    console.print(loaded.diagnosis, markup=False, soft_wrap=True)
    with shown_progress("distances to the mesh", console) as progress:
        distance_field_of(loaded.object, progress=progress)  # from now on it is in the cache
    return loaded.object


def hand_of(name: str, config: str) -> Any:
    """Return the hand of that name or of that model file.

    Raises
    ------
    InputError
        If the hand is unknown, a file is refused, or one of model and description is missing.
    """
    from surehold.grasping.hand.named import hand_named

    if not Path(name).suffix:
        if config:
            raise InputError(f"--hand-config describes a model file; give it as --hand, not '{name}'.")
        return hand_named(name)
    if not config:
        raise InputError(f"--hand {name} is a model file; describe its palm and fingers with --hand-config hand.yaml.")
    from surehold.grasping.hand.files import load_hand

    return load_hand(name, config)


class shown_progress:  # used as a function
    """Show a bar while something takes long; the value of the context takes the share that is done."""

    def __init__(self, what: str, console: Console):
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console, transient=True)
        self._what, self._task = what, None

    def __enter__(self) -> Callable[[float], None]:
        return self._show

    def _show(self, share: float) -> None:
        if not self._progress.console.is_terminal:
            return
        if self._task is None:  # nothing is shown of what is in the cache
            self._progress.start()
            self._task = self._progress.add_task(self._what, total=1.0)
        self._progress.update(self._task, completed=share)

    def __exit__(self, *error: object) -> None:
        if self._task is not None:
            self._progress.stop()
