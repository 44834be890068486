"""The options of a grasp: name, type, default, choices and help of each, once for all who read them.

`GraspOptions` are the keyword options of `surehold.problems.GraspProblem`; `DescribedGrasp` adds what words need where
Python has objects: the names or files of object and hand. The command line makes its options of this record, studies
store a `DescribedGrasp`, and plans of campaigns name its keys as arguments. A new option is one line here, and what it
does.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, TypedDict

from numpy.typing import ArrayLike

from surehold.choices import CLOSING_MODES, COLLISIONS, CONES, CONTACT_MODELS, QUALITIES
from surehold.errors import unknown_name

if TYPE_CHECKING:  # the command line reads this table where grasping, an extra, is not installed
    from surehold.grasping.hand.model import Hand

__all__ = [
    "AMPLITUDES",
    "OPTIONS",
    "PLANS",
    "THESIS_SIMULATOR",
    "VARIABLES",
    "DescribedGrasp",
    "GraspOption",
    "GraspOptions",
    "checked_words",
    "default_quality",
]

#: All variables of a grasp, and their units.
VARIABLES: Final[Mapping[str, str]] = {
    "dx": "m",
    "dy": "m",
    "dz": "m",
    "rx": "rad",
    "ry": "rad",
    "rz": "rad",
    "s1": "rad",
}

#: Further amplitudes of a synergy that was learned with more than two components, and their units.
AMPLITUDES: Final[Mapping[str, str]] = {"s2": "rad", "s3": "rad"}

#: What a grasp of an object of unknown shape is worth: the mean over draws of it, which costs as many trials, or that
#: on its mean shape. Grasps of half views were better where planned on draws (benchmarks/unknown_shapes.py grasp).
PLANS: Final = ("shapes", "mean")

#: What the preset "thesis" sets: the simulator behind the thesis. `s1` then ranges within +-pi.
THESIS_SIMULATOR: Final = {
    "contact": "single",
    "quality": "simox",
    "closing": "synergy",
    "cones": "polyhedral",
    "collision": "zero",
}


class GraspOption(NamedTuple):
    """What is said of an option, besides its name and its type in Python."""

    default: Any
    help: str
    choices: tuple[str, ...] = ()  #: valid names; empty where any value may be valid
    text: type | None = str  #: type on the command line; None for what a line of text cannot say


#: Free variables up to which a random pose often holds, so that epsilon, which is 0 elsewhere, tells a search enough.
#: Compared with two and with seven (benchmarks/signed_quality.py): no difference, and better answers with the slope.
_FEW: Final = 3
_QUALITY_HELP: Final = (
    f"One of {', '.join(QUALITIES)}; by default epsilon, with more than {_FEW} variables signed_epsilon, which tells a "
    "search where to go."
)


class GraspOptions(TypedDict, total=False):
    """The keyword options of a grasp problem; see `surehold.grasping.Simulator` for those of the simulator."""

    contact: Annotated[str, GraspOption("graded", "single, patch or graded (soft touch).", CONTACT_MODELS)]
    quality: Annotated[str, GraspOption("", _QUALITY_HELP, ("", *QUALITIES))]
    friction: Annotated[
        float | None,
        GraspOption(None, "Coefficient of friction; by default the hand's or the object's own.", text=float),
    ]
    torsion: Annotated[float, GraspOption(0.0, "Torsional friction of soft fingers [m]; 0: hard points.", text=float)]
    cones: Annotated[
        Literal["polyhedral", "round"],
        GraspOption("round", "Friction cones: round, or polyhedral of 8 edges.", CONES),
    ]
    collision: Annotated[
        str,
        GraspOption("penalty", "Worth of an open hand inside the object: penalty (below 0), or zero.", COLLISIONS),
    ]
    task: Annotated[ArrayLike | None, GraspOption(None, "Wrenches (k, 6) of the quality task.", text=None)]
    hand: Annotated[
        "str | Hand",
        GraspOption(
            "icub-left", "icub-left, icub-right, shadow, panda, a description (.yaml) or a model (.xml, .urdf)."
        ),
    ]
    preshape: Annotated[
        str | None, GraspOption("", "Type of grasp: power, tripod or pinch for the iCub, or a synergy file (.yaml).")
    ]
    closing: Annotated[
        str,
        GraspOption(
            "adaptive",
            "adaptive: links beyond a touching one go on; synergy: a touch stops the finger.",
            CLOSING_MODES,
        ),
    ]
    plan: Annotated[
        str, GraspOption("shapes", "Worth of a grasp of a cloud: mean over its shapes, or on its mean shape.", PLANS)
    ]
    preset: Annotated[str, GraspOption("", "thesis: the simulator of the thesis.", ("", "thesis"))]
    bounds: Annotated[
        Mapping[str, tuple[float, float]] | None, GraspOption(None, "Bounds of free variables.", text=None)
    ]
    fixed: Annotated[Mapping[str, float] | None, GraspOption(None, "Values of variables that are not free.", text=None)]


class DescribedGrasp(GraspOptions, total=False):
    """A grasp in words and numbers: what a command line, a stored study or a plan says."""

    object: Annotated[str, GraspOption("mug", "mug, bottle, glass, drill, or a mesh file (STL, OBJ, PLY, glTF, GLB).")]
    facet: Annotated[
        str,
        GraspOption(
            "",
            "The facet that the palm faces, then the one at the thumb; by default right-front, of the drill "
            "bottom-front.",
        ),
    ]
    variables: Annotated[
        Sequence[str],
        GraspOption(
            ("dx", "dy"), f"Free variables, of {','.join(VARIABLES)}; of a synergy file also s2,s3.", text=list
        ),
    ]
    unit: Annotated[str, GraspOption("", "Unit of a mesh file or a cloud: mm, cm, m or in.")]
    mass: Annotated[
        float | None,
        GraspOption(None, "Mass of a mesh or a cloud [kg]; by default that of water.", text=float),
    ]
    frame: Annotated[str | None, GraspOption(None, "Axes of a mesh's box: file, principal, or auto (the smaller).")]
    hand_config: Annotated[str, GraspOption("", "YAML description of a hand's model file: palm, fingers, preshapes.")]
    cloud: Annotated[str, GraspOption("", "Point cloud of the object instead: .ply, .pcd, .xyz or .npz.")]
    camera: Annotated[
        str | Sequence[float], GraspOption("", "Where the cloud was seen from: x,y,z in the file's unit.")
    ]
    normals: Annotated[bool, GraspOption(False, "Take the normals that the cloud's file holds.", text=bool)]
    contacts: Annotated[
        str,
        GraspOption("", "Touches of a cloud's object, JSON: {contacts: [{point, normal}, ..]} in its frame [m]."),
    ]
    cloud_noise: Annotated[
        float | None, GraspOption(None, "Standard deviation of a cloud's points [m]; measured by default.", text=float)
    ]
    prior: Annotated[
        str, GraspOption("mirror", "What a cloud does not show: mirror (of what it shows), box or ellipsoid.")
    ]
    shapes: Annotated[
        int, GraspOption(8, "Equally likely shapes of a cloud, which tell what its unknown side may cost.", text=int)
    ]


_HINTS: Final[dict[str, Any]] = DescribedGrasp.__annotations__
#: Name -> option, of `DescribedGrasp`: what is grasped comes first.
OPTIONS: Final[Mapping[str, GraspOption]] = {
    name: _HINTS[name].__metadata__[0] for name in sorted(_HINTS, key=lambda name: name in GraspOptions.__annotations__)
}


def default_quality(variables: Sequence[str], preset: str) -> str:
    """Return the quality where none is named."""
    if preset:
        return THESIS_SIMULATOR["quality"]
    return "signed_epsilon" if len(variables) > _FEW else "epsilon"


def checked_words(words: Mapping[str, Any], what: str = "option of a grasp") -> dict[str, Any]:
    """Return a description with the defaults of what it leaves open.

    Raises
    ------
    InputError
        If it names an option that does not exist; `what` it is called in the message.
    """
    named = {name.replace(" ", "_"): value for name, value in words.items()}  # stored studies say "hand config"
    for name in named:
        if name not in OPTIONS:
            raise unknown_name(what, name, OPTIONS)
    given: dict[str, Any] = {name: option.default for name, option in OPTIONS.items()} | named
    return given | {"quality": given["quality"] or default_quality(given["variables"], given["preset"])}
