"""The hand and what it grasps: objects, distance fields, closing, contacts, wrenches. Knows no optimizer."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.grasping.batch import GraspBatch, grasp_batch
    from surehold.grasping.choices import CLOSING_MODES, COLLISIONS, CONTACT_MODELS, QUALITIES
    from surehold.grasping.closing.contacts import Contacts
    from surehold.grasping.formats import GraspFile, StoredGrasp, grasp_to_dict, read_isaac_grasps, write_isaac_grasps
    from surehold.grasping.grasp import STATUSES, Grasp
    from surehold.grasping.hand.icub import icub_left_hand, icub_right_hand
    from surehold.grasping.hand.model import Hand, Preshape
    from surehold.grasping.hand.named import HANDS, hand_named
    from surehold.grasping.object.distance_field import DistanceField, distance_field_of
    from surehold.grasping.object.model import GraspObject
    from surehold.grasping.object.shipped import OBJECTS, shipped_object
    from surehold.grasping.physics.check import GraspCheck, GraspChecker
    from surehold.grasping.pictures.scene import Scene, SceneMesh, grasp_scene
    from surehold.grasping.pose_noise import PoseNoise, RobustQuality, robust_quality
    from surehold.grasping.poses import FACETS, MODES, Pose, default_pose
    from surehold.grasping.simulator import Simulator
    from surehold.grasping.wrench.force_closure import force_closure, gravity_wrenches, task_quality
    from surehold.grasping.wrench.friction_cones import contact_wrenches, soft_finger_torsion
    from surehold.grasping.wrench.hull.inscribed_ball import ball_radius
    from surehold.grasping.wrench.simox import ObjectWrenchSpace, object_wrench_space, simox_quality
    from surehold.grasping.wrench.wrench_space import WrenchQuality, wrench_quality

_HOMES = {
    "CLOSING_MODES": "choices",
    "COLLISIONS": "choices",
    "CONTACT_MODELS": "choices",
    "Contacts": "closing.contacts",
    "DistanceField": "object.distance_field",
    "FACETS": "poses",
    "Grasp": "grasp",
    "GraspBatch": "batch",
    "GraspCheck": "physics.check",
    "GraspChecker": "physics.check",
    "GraspFile": "formats",
    "GraspObject": "object.model",
    "HANDS": "hand.named",
    "Hand": "hand.model",
    "MODES": "poses",
    "OBJECTS": "object.shipped",
    "ObjectWrenchSpace": "wrench.simox",
    "Pose": "poses",
    "PoseNoise": "pose_noise",
    "Preshape": "hand.model",
    "QUALITIES": "choices",
    "RobustQuality": "pose_noise",
    "STATUSES": "grasp",
    "Scene": "pictures.scene",
    "SceneMesh": "pictures.scene",
    "Simulator": "simulator",
    "StoredGrasp": "formats",
    "WrenchQuality": "wrench.wrench_space",
    "ball_radius": "wrench.hull.inscribed_ball",
    "contact_wrenches": "wrench.friction_cones",
    "default_pose": "poses",
    "distance_field_of": "object.distance_field",
    "force_closure": "wrench.force_closure",
    "grasp_batch": "batch",
    "grasp_scene": "pictures.scene",
    "grasp_to_dict": "formats",
    "gravity_wrenches": "wrench.force_closure",
    "hand_named": "hand.named",
    "icub_left_hand": "hand.icub",
    "icub_right_hand": "hand.icub",
    "object_wrench_space": "wrench.simox",
    "read_isaac_grasps": "formats",
    "robust_quality": "pose_noise",
    "shipped_object": "object.shipped",
    "simox_quality": "wrench.simox",
    "soft_finger_torsion": "wrench.friction_cones",
    "task_quality": "wrench.force_closure",
    "wrench_quality": "wrench.wrench_space",
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
