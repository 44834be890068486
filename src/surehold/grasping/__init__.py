"""The hand and what it grasps: objects, distance fields, closing, contacts, wrenches. Knows no optimizer."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.grasping.closing import CLOSING_MODES
    from surehold.grasping.contacts import CONTACT_MODELS, Contacts
    from surehold.grasping.distance_field import DistanceField, distance_field
    from surehold.grasping.grasp import QUALITIES, STATUSES, Grasp, Simulator
    from surehold.grasping.hand import Hand, icub_left_hand
    from surehold.grasping.meshes import OBJECTS, GraspObject, shipped_object
    from surehold.grasping.poses import FACETS, MODES, Pose, default_pose
    from surehold.grasping.scene import Scene, SceneMesh, grasp_scene
    from surehold.grasping.wrench_space import WrenchQuality, wrench_quality

_HOMES = {
    "CLOSING_MODES": "closing",
    "CONTACT_MODELS": "contacts",
    "Contacts": "contacts",
    "DistanceField": "distance_field",
    "FACETS": "poses",
    "Grasp": "grasp",
    "GraspObject": "meshes",
    "Hand": "hand",
    "MODES": "poses",
    "OBJECTS": "meshes",
    "Pose": "poses",
    "QUALITIES": "grasp",
    "STATUSES": "grasp",
    "Scene": "scene",
    "SceneMesh": "scene",
    "Simulator": "grasp",
    "WrenchQuality": "wrench_space",
    "default_pose": "poses",
    "distance_field": "distance_field",
    "grasp_scene": "scene",
    "icub_left_hand": "hand",
    "shipped_object": "meshes",
    "wrench_quality": "wrench_space",
}

__all__ = [
    "CLOSING_MODES",
    "CONTACT_MODELS",
    "FACETS",
    "MODES",
    "OBJECTS",
    "QUALITIES",
    "STATUSES",
    "Contacts",
    "DistanceField",
    "Grasp",
    "GraspObject",
    "Hand",
    "Pose",
    "Scene",
    "SceneMesh",
    "Simulator",
    "WrenchQuality",
    "default_pose",
    "distance_field",
    "grasp_scene",
    "icub_left_hand",
    "shipped_object",
    "wrench_quality",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
