"""The hand and what it grasps: objects, distance fields, closing, contacts, wrenches. Knows no optimizer."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.grasping.batch import GraspBatch, grasp_batch
    from surehold.grasping.closing import CLOSING_MODES
    from surehold.grasping.contacts import CONTACT_MODELS, Contacts
    from surehold.grasping.distance_field import DistanceField, distance_field_of
    from surehold.grasping.dynamics import GraspCheck, GraspChecker
    from surehold.grasping.formats import GraspFile, StoredGrasp, grasp_to_dict, read_isaac_grasps, write_isaac_grasps
    from surehold.grasping.friction_cones import contact_wrenches, soft_finger_torsion
    from surehold.grasping.grasp import COLLISIONS, STATUSES, Grasp, Simulator
    from surehold.grasping.hand import Hand, Preshape
    from surehold.grasping.hands import HANDS, hand_named
    from surehold.grasping.icub_hand import icub_left_hand, icub_right_hand
    from surehold.grasping.inscribed_ball import ball_radius
    from surehold.grasping.linear_programs import force_closure, gravity_wrenches, task_quality
    from surehold.grasping.meshes import OBJECTS, GraspObject, shipped_object
    from surehold.grasping.pose_noise import PoseNoise, RobustQuality, robust_quality
    from surehold.grasping.poses import FACETS, MODES, Pose, default_pose
    from surehold.grasping.quality import QUALITIES
    from surehold.grasping.scene import Scene, SceneMesh, grasp_scene
    from surehold.grasping.simox import ObjectWrenchSpace, object_wrench_space, simox_quality
    from surehold.grasping.wrench_space import WrenchQuality, wrench_quality

_HOMES = {
    "CLOSING_MODES": "closing",
    "COLLISIONS": "grasp",
    "CONTACT_MODELS": "contacts",
    "Contacts": "contacts",
    "DistanceField": "distance_field",
    "FACETS": "poses",
    "Grasp": "grasp",
    "GraspBatch": "batch",
    "GraspCheck": "dynamics",
    "GraspChecker": "dynamics",
    "GraspFile": "formats",
    "GraspObject": "meshes",
    "HANDS": "hands",
    "Hand": "hand",
    "MODES": "poses",
    "OBJECTS": "meshes",
    "ObjectWrenchSpace": "simox",
    "Pose": "poses",
    "PoseNoise": "pose_noise",
    "Preshape": "hand",
    "QUALITIES": "quality",
    "RobustQuality": "pose_noise",
    "STATUSES": "grasp",
    "Scene": "scene",
    "SceneMesh": "scene",
    "Simulator": "grasp",
    "StoredGrasp": "formats",
    "WrenchQuality": "wrench_space",
    "ball_radius": "inscribed_ball",
    "contact_wrenches": "friction_cones",
    "default_pose": "poses",
    "distance_field_of": "distance_field",
    "force_closure": "linear_programs",
    "grasp_batch": "batch",
    "grasp_scene": "scene",
    "grasp_to_dict": "formats",
    "gravity_wrenches": "linear_programs",
    "hand_named": "hands",
    "icub_left_hand": "icub_hand",
    "icub_right_hand": "icub_hand",
    "object_wrench_space": "simox",
    "read_isaac_grasps": "formats",
    "robust_quality": "pose_noise",
    "shipped_object": "meshes",
    "simox_quality": "simox",
    "soft_finger_torsion": "friction_cones",
    "task_quality": "linear_programs",
    "wrench_quality": "wrench_space",
    "write_isaac_grasps": "formats",
}

__all__ = [
    "CLOSING_MODES",
    "COLLISIONS",
    "CONTACT_MODELS",
    "FACETS",
    "HANDS",
    "MODES",
    "OBJECTS",
    "QUALITIES",
    "STATUSES",
    "Contacts",
    "DistanceField",
    "Grasp",
    "GraspBatch",
    "GraspCheck",
    "GraspChecker",
    "GraspFile",
    "GraspObject",
    "Hand",
    "ObjectWrenchSpace",
    "Pose",
    "PoseNoise",
    "Preshape",
    "RobustQuality",
    "Scene",
    "SceneMesh",
    "Simulator",
    "StoredGrasp",
    "WrenchQuality",
    "ball_radius",
    "contact_wrenches",
    "default_pose",
    "distance_field_of",
    "force_closure",
    "grasp_batch",
    "grasp_scene",
    "grasp_to_dict",
    "gravity_wrenches",
    "hand_named",
    "icub_left_hand",
    "icub_right_hand",
    "object_wrench_space",
    "read_isaac_grasps",
    "robust_quality",
    "shipped_object",
    "simox_quality",
    "soft_finger_torsion",
    "task_quality",
    "wrench_quality",
    "write_isaac_grasps",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
