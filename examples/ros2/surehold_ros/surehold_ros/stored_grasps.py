"""Grasps of an Isaac grasp file, as `surehold grasp` writes it, without ROS in it; quaternions are (x, y, z, w)."""

from dataclasses import dataclass
from typing import Any

import yaml

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Planned:
    """A grasp, and where the gripper is for it."""

    name: str
    quality: float
    position: Vector
    orientation: Quaternion
    closed: dict[str, float]
    open: dict[str, float]


@dataclass(frozen=True)
class GraspsOf:
    """The grasps of one object, best first, in the object's frame."""

    object: str
    gripper_frame: str
    grasps: tuple[Planned, ...]


def read(path: str) -> GraspsOf:
    """Read a file of grasps; those of confidence 0 are left out."""
    with open(path, encoding="utf-8") as file:
        content: Any = yaml.safe_load(file)
    if not isinstance(content, dict) or content.get("format") != "isaac_grasp":
        raise ValueError(f"{path} is not an Isaac grasp file")
    if float(content.get("format_version", 0.0)) != 1.0:
        raise ValueError(f"{path} has format_version {content.get('format_version')}; 1.0 is supported")
    grasps = []
    for name, entry in content["grasps"].items():
        turn = entry["orientation"]
        x, y, z = (float(v) for v in turn["xyz"])
        planned = Planned(
            str(name),
            float(entry.get("confidence", 1.0)),
            tuple(float(v) for v in entry["position"]),
            (x, y, z, float(turn["w"])),
            {str(joint): float(q) for joint, q in (entry.get("cspace_position") or {}).items()},
            {str(joint): float(q) for joint, q in (entry.get("pregrasp_cspace_position") or {}).items()},
        )
        if planned.quality > 0.0:
            grasps.append(planned)
    grasps.sort(key=lambda grasp: -grasp.quality)
    return GraspsOf(str(content.get("object_frame", "")), str(content.get("gripper_frame", "")), tuple(grasps))


def placed(position: Vector, orientation: Quaternion, grasp: Planned) -> tuple[Vector, Quaternion]:
    """Return where the gripper is if the object is at this pose."""
    shift = turned(orientation, grasp.position)
    a = tuple(p + s for p, s in zip(position, shift, strict=True))
    return a, product(orientation, grasp.orientation)


def turned(q: Quaternion, v: Vector) -> Vector:
    """Return a vector turned by a unit quaternion: v + 2 u x (u x v + w v)."""
    x, y, z, w = q
    tx, ty, tz = (2.0 * c for c in (y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]))
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the quaternion that first turns by b, then by a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
