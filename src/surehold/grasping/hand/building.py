"""A hand from a model at rest: fingers as chains of joints and capsules, the palm as boxes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.hand.coupling import JointCouplings
from surehold.grasping.hand.cover import SHORTEST
from surehold.grasping.hand.geometry import link_parts, palm_boxes
from surehold.grasping.hand.model import Hand, LinkBox, chain_row
from surehold.grasping.hand.preshapes import described_preshape
from surehold.grasping.hand.rest import RestingModel

__all__ = ["built_hand"]

Array = NDArray[np.float64]
_SMALLEST, _LARGEST = 0.01, 1.0  # of a hand, from the palm to the farthest tip [m]


class _Finger(NamedTuple):
    base: Array  #: (3, 4)
    chain: Array  #: (n, 19)
    radii: Array  #: (n,)
    joints: list[int | None]  #: (n,) numbers in the model
    bodies: list[int]  #: (n,) numbers in the model; -1 for a link that is not there
    boxes: list[LinkBox]  #: links by their numbers in the finger


def built_hand(rest: RestingModel, file: str) -> Hand:
    """Return the hand of a model at rest, read from `file`."""
    config, couplings = rest.config, JointCouplings(rest)
    rows = [_finger(rest, finger, joints) for finger, joints in rest.fingers.items()]
    _check_size(rest, rows)
    longest = max(len(row.chain) for row in rows)
    f = len(rows)
    chains, radii = np.zeros((f, longest, 19)), np.zeros((f, longest))
    lower, upper = np.zeros((f, longest)), np.zeros((f, longest))
    names = [["" for _ in range(longest)] for _ in rows]
    links = [[f"{finger} {k + 1}" for k in range(longest)] for finger in rest.fingers]
    chains[:, :] = chain_row(np.zeros(3), np.array([SHORTEST, 0.0, 0.0]), np.eye(3, 4))
    for i, row in enumerate(rows):
        n = len(row.chain)
        chains[i, :n], radii[i, :n] = row.chain, row.radii
        for k, j in enumerate(row.joints):
            if j is not None:
                names[i][k] = rest.joint_names[j]
                lower[i, k], upper[i, k] = couplings.range(j)
        links[i][:n] = [rest.body_names[b] if b >= 0 else links[i][k] for k, b in enumerate(row.bodies)]
    boxes = palm_boxes(rest)
    joined = np.zeros((f, longest, len(boxes)), dtype=bool)
    for i, row in enumerate(rows):
        for k, body in enumerate(row.bodies):
            joined[i, k] = [body >= 0 and rest.joined(body, box.body) for box in boxes]
    flat = tuple(name for row in names for name in row)
    return Hand(
        name=config.name,
        bases=np.stack([row.base for row in rows]),
        chains=chains,
        radii=radii,
        lower=lower,
        upper=upper,
        palm_poses=np.stack([box.pose for box in boxes]) if boxes else np.empty((0, 3, 4)),
        palm_half_extents=np.stack([box.half for box in boxes]) if boxes else np.empty((0, 3)),
        palm_roundings=np.array([box.rounding for box in boxes]),
        grasp_center=np.asarray(config.palm.grasp_center),
        finger_names=tuple(rest.fingers),
        link_names=tuple(name for row in links for name in row),
        joint_names=flat,
        preshapes={name: described_preshape(name, rest, couplings, flat) for name in config.preshapes},
        joined=joined.reshape(f * longest, -1),
        boxes=tuple(
            box._replace(links=tuple(i * longest + k for k in box.links))
            for i, row in enumerate(rows)
            for box in row.boxes
        ),
        finger_force=config.finger_force,
        friction=config.friction,
        model=rest.source(file),
        sources={
            **({} if "finger_force" in config.model_fields_set else {"finger_force": "assumed"}),
            **config.sources,
        },
    )


def _check_size(rest: RestingModel, rows: list[_Finger]) -> None:
    """Raise InputError for a hand that is no hand by its size."""
    name, palm = rest.config.name, rest.config.palm
    sizes = []
    for row in rows:
        offsets = row.chain[:, 7:].reshape(-1, 3, 4)[:, :, 3]
        along = np.linalg.norm(offsets, axis=1).sum() + np.linalg.norm(row.chain[:, 4:7], axis=1).max()
        sizes.append(float(np.linalg.norm(row.base[:, 3]) + along))
    size = float(np.max(sizes))
    if not np.isfinite(size):
        raise InputError(f"the model of hand '{name}' has numbers that are not finite; repair it.")
    if not _SMALLEST <= size <= _LARGEST:
        raise InputError(
            f"hand '{name}' reaches {1e3 * size:.3g} mm from its palm's origin; MuJoCo takes lengths as meters, "
            f"and a hand is {1e3 * _SMALLEST:g} to {1e3 * _LARGEST:g} mm long."
        )
    far = float(np.linalg.norm(palm.grasp_center))
    if far > 2.0 * size:
        raise InputError(
            f"hand '{name}': palm.grasp_center is {1e3 * far:.3g} mm away, the fingers reach {1e3 * size:.3g} mm; "
            "give it in meters, between palm and fingers."
        )


def _finger(rest: RestingModel, finger: str, joints: list[int]) -> _Finger:
    frames = []
    for j in joints:
        z = rest.data.xaxis[j]
        x = np.eye(3)[int(np.argmin(np.abs(z)))]
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        frames.append(rest.placed(rest.data.xanchor[j], np.column_stack([x, np.cross(z, x), z])))
    chain, radii, owners, bodies, boxes = [], [], [], [], []
    for k, j in enumerate(joints):
        p, r = frames[k]
        capsules = []
        for part in link_parts(rest, finger, k):
            if part.box is not None:
                pose, half = part.box
                inside = tuple(range(len(chain) + len(capsules), len(chain) + len(capsules) + len(part.capsules)))
                boxes.append(LinkBox(inside, r.T @ np.column_stack([pose[:, :3], pose[:, 3] - p]), half))
            capsules += [(part.body, r.T @ (near - p), r.T @ (far - p), radius) for near, far, radius in part.capsules]
        if not capsules:
            capsules = [(-1, np.zeros(3), np.array([SHORTEST, 0.0, 0.0]), 0.0)]
        if k + 1 < len(joints):
            q, s = frames[k + 1]
            offset = np.column_stack([r.T @ s, r.T @ (q - p)])
        else:
            offset = np.eye(3, 4)
        slides = rest.model.jnt_type[j] == int(rest.mujoco.mjtJoint.mjJNT_SLIDE)
        for i, (body, near, far, radius) in enumerate(capsules):
            end = i + 1 == len(capsules)
            chain.append(chain_row(near, far, offset if end else np.eye(3, 4), bool(slides and i == 0)))
            radii.append(radius)
            owners.append(j if i == 0 else None)
            bodies.append(body)
    if not any(radii):
        raise InputError(f"finger '{finger}' of hand '{rest.config.name}' has no geometry that can touch.")
    base = np.column_stack([frames[0][1], frames[0][0]])
    return _Finger(base, np.stack(chain), np.array(radii), owners, bodies, boxes)
