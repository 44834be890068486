"""The description of a hand beside its model: a short YAML file.

    name: my-hand
    model: {file: my_hand.xml}     # optional: the model, seen from this file's folder; then this file alone is a hand
    palm:
      body: palm_link              # the body that everything is measured from
      origin: [0, 0, 0]            # of the palm frame, in that body's frame [m]
      x: [0, 0, 1]                 # along the fingers, in that body's frame
      z: [0, -1, 0]                # out of the palm, towards what is grasped
      grasp_center: [0.09, 0, 0.03]  # in the palm frame [m]: where an object shall be
    fingers:                       # joints from the palm to the tip: the order in which they close
      index: [index_1, index_2, index_3]
      thumb: [thumb_1, thumb_2]
    coupling:                      # optional: q = factor * leader + offset, beside what the model couples (coupling.py)
      index_3: {follows: index_2, factor: 0.8}
    contact_links: [index_tip]     # optional: only these bodies of the fingers can touch; all of them otherwise
    finger_force: 8                # optional: what a stretched finger can exert at its tip [N]
    friction: 0.6                  # optional: coefficient of its skin on objects; the object's own otherwise
    sources: {finger_force: maker's data sheet}   # optional: where these two numbers come from, for the report
    preshapes:                     # types of grasp; the first one is the default [rad or m]
      power:
        open: {index_1: 0.1}       # joints that are not named are at 0, or at the nearest end of their range
        closed: {index_1: 1.6, index_2: 1.5, thumb_1: 0.8}
        posture: {range: [-1, 1], joints: {thumb_1: 0.4}}   # optional: what the variable s1 moves, per unit of s1

Joints that no finger names do not move. Lengths are in meters, angles in radians, whatever the model's own unit.
"""

from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from surehold.errors import InputError
from surehold.grasping.hand.description_mistakes import mistakes_in_words
from surehold.grasping.plain_data import plain_yaml

__all__ = [
    "Coupling",
    "HandConfig",
    "ModelFile",
    "PackagedModel",
    "PalmConfig",
    "Posture",
    "PreshapeConfig",
    "read_hand_config",
]

Vector = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Joints = dict[str, FiniteFloat]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PackagedModel(_Strict):
    """Where a shipped description finds its model: a file inside an installed package."""

    package: str
    distribution: str
    path: str


class ModelFile(_Strict):
    """Where a description finds its model: a path seen from the description's own folder."""

    file: Annotated[str, Field(min_length=1)]


class PalmConfig(_Strict):
    """The palm frame, and where an object shall be."""

    body: str
    origin: Vector = [0.0, 0.0, 0.0]
    x: Vector
    z: Vector
    grasp_center: Vector


class Coupling(_Strict):
    """A joint that follows another one."""

    follows: str
    factor: FiniteFloat = 1.0
    offset: FiniteFloat = 0.0


class Posture(_Strict):
    """What the posture variable moves."""

    range: Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]
    joints: Joints

    @model_validator(mode="after")
    def _ordered(self) -> "Posture":
        if not self.range[0] < self.range[1]:
            raise ValueError(f"range {self.range} must be two numbers, the smaller one first")
        return self


class PreshapeConfig(_Strict):
    """One type of grasp."""

    open: Joints = {}
    closed: Joints
    posture: Posture | None = None


class HandConfig(_Strict):
    """A hand's description."""

    name: Annotated[str, Field(min_length=1, max_length=60)]
    palm: PalmConfig
    fingers: Annotated[dict[str, Annotated[list[str], Field(min_length=1, max_length=8)]], Field(min_length=1)]
    coupling: dict[str, Coupling] = {}
    contact_links: list[str] | None = None
    finger_force: Annotated[FiniteFloat, Field(gt=0.0, le=1000.0)] = 8.0
    friction: Annotated[FiniteFloat, Field(gt=0.0, le=10.0)] | None = None
    sources: dict[Literal["finger_force", "friction"], Annotated[str, Field(max_length=200)]] = {}
    preshapes: Annotated[dict[str, PreshapeConfig], Field(min_length=1)]
    model: PackagedModel | ModelFile | None = None


#: Valid keys of each mapping whose keys are not the author's own.
_KEYS: Final = {
    "": tuple(HandConfig.model_fields),
    "palm": tuple(PalmConfig.model_fields),
    "model": (*ModelFile.model_fields, *PackagedModel.model_fields),
    "sources": ("finger_force", "friction"),
    "coupling.*": tuple(Coupling.model_fields),
    "preshapes.*": tuple(PreshapeConfig.model_fields),
    "preshapes.*.posture": tuple(Posture.model_fields),
}


def read_hand_config(path: str | Path) -> HandConfig:
    """Read a hand's description.

    Raises
    ------
    InputError
        If the file cannot be read, is not plain YAML, or entries are missing, unknown or of the wrong kind; the
        message names them with their lines.
    """
    content: Any = plain_yaml(path)
    if not isinstance(content, dict):
        raise InputError(f"{str(path)!r} is no hand description; it must map name, palm, fingers and preshapes.")
    try:
        return HandConfig.model_validate(content)
    except ValidationError as error:
        said = mistakes_in_words(path, content, error.errors(), _KEYS)
        raise InputError(
            f"{str(path)!r}: {said}. All keys are in the docstring of surehold.grasping.hand.configuration."
        ) from None
