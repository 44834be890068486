"""From a closed hand to contacts: points on the object, inward normals, weights (compiled).

    d       gap between a sample of the hand's skin and the object, m
    delta   depth of the soft touch, m
    w       weight of a contact, 1 - d / delta, in (0, 1]
    rho     thickness of the skin, m; m is a sample's outward normal on the hand, x its place

`single`   one contact for each link that touches: the point of the object nearest to the link. What is touched can
           switch from one side of an edge to the other, so the quality is rough in the pose.
`patch`    every skin sample within delta is a contact of full weight; on and off as samples enter and leave.
`graded`   every skin sample within delta is a contact of weight w: continuous in pose and joint angles, because
           a contact fades in and out. The skin is sampled at fixed places of each link and of the palm.

`graded` also feels what a link brushes past: see `Closed` in closing.py. A pass of gap g counts as a touch by the
share a = (1 - g / delta) min(1, 4 (l - g) / delta), with l the gap to which the link leaves again. Each sample is the
mixture of what it feels with the link held at the closest approach (share a) and with the link gone on (1 - a): the
contact force that is the weighted mean of both, at the weighted mean of both points. A hit fades into a miss.

Point and normal of a skin contact are those of the object's surface nearest to x - rho m, below the skin: bare x would
see the normal turn over at once where it passes a sharp edge, a skin of thickness rho rolls over it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.closing.clearance import capsule_gap
from surehold.grasping.hand.model import Hand, link_frames
from surehold.grasping.object.distance_field import field_distance, field_distance_gradient
from surehold.store.kernels import njit

__all__ = [
    "CONTACT_MODELS",
    "DEPTH",
    "Contacts",
    "as_contacts",
    "blended",
    "pass_share",
    "skin_contacts",
    "skin_samples",
    "touch_contacts",
]

Array = NDArray[np.float64]

CONTACT_MODELS: Final = ("graded", "patch", "single")
DEPTH: Final = 0.006  #: depth of the soft touch, delta [m]: what is so near is reached as finger and object give way
SKIN: Final = 0.002  #: thickness of the skin, rho [m]
STATIONS: Final = 5  #: rings of samples along a link
AROUND: Final = 8  #: samples on a ring
PALM_PITCH: Final = 0.008  #: largest distance between samples of the palm [m]


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a grasp, in the frame of the object."""

    points: NDArray[np.float64] = field(repr=False)  #: (c, 3) on the object's surface [m]
    normals: NDArray[np.float64] = field(repr=False)  #: (c, 3) unit length, into the object
    weights: NDArray[np.float64] = field(repr=False)  #: (c,) in (0, 1]
    bodies: NDArray[np.int64] = field(repr=False)  #: (c,) number of the touching body of the hand
    names: tuple[str, ...] = field(repr=False, default=())  #: (c,) its name, such as "thumb distal" or "palm"

    def __len__(self) -> int:
        return len(self.points)


@njit(cache=True)
def _put(rows, n, nodes, frame, x, y, z, weight, body):
    """Write the contact nearest to the point x, y, z into row n: point (3), inward normal (3), weight, body."""
    d, gx, gy, gz = field_distance_gradient(nodes, frame, x, y, z)
    norm = np.sqrt(gx * gx + gy * gy + gz * gz)
    if norm < 1e-6:  # exactly between two surfaces: there is no nearest one
        return n
    gx, gy, gz = gx / norm, gy / norm, gz / norm
    rows[n, 0], rows[n, 1], rows[n, 2] = x - d * gx, y - d * gy, z - d * gz
    rows[n, 3], rows[n, 4], rows[n, 5] = -gx, -gy, -gz
    rows[n, 6], rows[n, 7] = weight, body
    return n + 1


@njit(cache=True)
def touch_contacts(nodes, frame, ends, touched, radii):
    """Return one contact (c, 8) for each link that touched: point, inward normal, weight 1, body."""
    rows = np.empty((touched.size, 8))
    n = 0
    for body in range(touched.size):
        if touched[body]:
            near, far = ends[body, 0], ends[body, 1]
            radius = radii[body // radii.shape[1], body % radii.shape[1]]
            s = capsule_gap(nodes, frame, near, far, radius, 1e-7, 0.0)[1]
            p = near + s * (far - near)
            n = _put(rows, n, nodes, frame, p[0], p[1], p[2], 1.0, body)
    return rows[:n]


def link_samples(radius: float, length: float, round_end: bool) -> Array:
    """Return skin samples (m, 6) of a link along z: place, outward normal. `round_end` adds the far end's half ball.

    A ring of `AROUND` samples at the middle of each of `STATIONS` equal pieces; on the half ball two rings and the tip.
    """
    rings = [(length * (s + 0.5) / STATIONS, 0.0, AROUND) for s in range(STATIONS)]
    if round_end:
        rings += [(length, np.pi / 6.0, AROUND), (length, np.pi / 3.0, AROUND // 2), (length, np.pi / 2.0, 1)]
    rows = []
    for height, latitude, count in rings:
        angle = 2.0 * np.pi * np.arange(count) / count
        c = np.cos(latitude)
        normal = np.column_stack([c * np.cos(angle), c * np.sin(angle), np.full(count, np.sin(latitude))])
        rows.append(np.column_stack([radius * normal + [0.0, 0.0, height], normal]))
    return np.vstack(rows)


def palm_samples(half: Array, rounding: float) -> Array:
    """Return skin samples (m, 6) of the flat face of a palm's box towards its +z: place and outward normal."""
    reach = half[:2] - rounding
    u, v = (r * np.linspace(-1.0, 1.0, int(np.ceil(2.0 * r / PALM_PITCH)) + 1) for r in reach)
    place = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    n = len(place)
    return np.column_stack([place, np.full(n, half[2]), np.zeros((n, 2)), np.ones(n)])


def skin_samples(hand: Hand) -> Array:
    """Return all skin samples (m, 7) of a hand: number of the body; place [m] and outward normal in its frame.

    The frame of a link is that of the joint that moves it. Samples inside another capsule of the same rigid link, and
    samples of the palm inside another box of it, are left out.
    """
    parts: list[Array] = []
    fingers, joints = hand.radii.shape
    for f in range(fingers):
        present = np.flatnonzero(hand.radii[f] > 0.0)
        moving = np.flatnonzero(hand.upper[f] > hand.lower[f])
        last = moving[-1] if len(moving) else 0
        for k in present:
            near = hand.chains[f, k, 1:4]
            axes, length = _link_axes(hand, f, int(k))
            local = link_samples(float(hand.radii[f, k]), length, bool(k >= last))
            place, normal = near + local[:, :3] @ axes.T, local[:, 3:] @ axes.T
            parts.append(np.column_stack([np.full(len(place), f * joints + k), place, normal]))
    for pose, half, rounding in zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True):
        towards = int(np.argmax(np.abs(pose[2, :3])))  # the axis of the box that looks out of the palm
        turn = np.roll(np.eye(3), towards - 2, axis=1) if towards != 2 else np.eye(3)
        turn = turn * np.array([1.0, 1.0, 1.0 if pose[2, towards] > 0.0 else -1.0])
        local = palm_samples(np.abs(half @ turn), float(rounding))
        place, normal = pose[:, 3] + local[:, :3] @ (pose[:, :3] @ turn).T, local[:, 3:] @ (pose[:, :3] @ turn).T
        parts.append(np.column_stack([np.full(len(place), hand.palm), place, normal]))
    samples = np.vstack(parts)
    return samples[~_buried(hand, samples)]


def _link_axes(hand: Hand, f: int, k: int) -> tuple[Array, float]:
    """Return the axes (3, 3) of a link's samples, z along the link and x along its bending axis, and its length."""
    along = hand.chains[f, k, 4:7] - hand.chains[f, k, 1:4]
    length = float(np.linalg.norm(along))
    z = along / length
    side = np.array([0.0, 0.0, 1.0])
    if k == 0 and hand.radii.shape[1] > 1:  # the first joint spreads the finger, the second one bends it
        side = hand.chains[f, 0, 7:].reshape(3, 4)[:, 2]
    side = side - (side @ z) * z
    if np.linalg.norm(side) < 0.1:
        side = np.eye(3)[int(np.argmin(np.abs(z)))]
        side = side - (side @ z) * z
    x = side / np.linalg.norm(side)
    return np.column_stack([x, np.cross(z, x), z]), length


def _buried(hand: Hand, samples: Array) -> NDArray[np.bool_]:
    """Return which samples (m, 7) lie inside another capsule of the same rigid link, or box of the palm."""
    fingers, joints = hand.radii.shape
    rest = 0.5 * (hand.lower + hand.upper)
    frames = link_frames(hand.bases, hand.chains, rest)
    rigid = np.cumsum(hand.upper > hand.lower, axis=1)  # links of a finger with the same number move together
    body = samples[:, 0].astype(int)
    buried = np.zeros(len(samples), dtype=bool)
    for f in range(fingers):
        for k in range(joints):
            group = [f * joints + m for m in range(joints) if m != k and rigid[f, m] == rigid[f, k]]
            mine = np.flatnonzero(np.isin(body, group))
            if not len(mine) or hand.radii[f, k] <= 0.0:
                continue
            placed = np.einsum("mij,mj->mi", frames[body[mine], :, :3], samples[mine, 1:4]) + frames[body[mine], :, 3]
            near, far = (frames[f * joints + k] @ np.append(hand.chains[f, k, i : i + 3], 1.0) for i in (1, 4))
            share = np.clip((placed - near) @ (far - near) / ((far - near) @ (far - near)), 0.0, 1.0)
            away = np.linalg.norm(placed - near - share[:, None] * (far - near), axis=1)
            buried[mine] |= away < hand.radii[f, k] - 1e-6
    mine = np.flatnonzero(body == hand.palm)
    for pose, half in zip(hand.palm_poses, hand.palm_half_extents, strict=True):
        inside = np.abs((samples[mine, 1:4] - pose[:, 3]) @ pose[:, :3]) < half - 1e-6
        buried[mine] |= np.all(inside, axis=1)
    return buried


@njit(cache=True)
def skin_contacts(nodes, frame, frames, chains, radii, palm, samples, depth, skin, graded):
    """Return contacts (m, 8) of all skin samples (m, 7): point, inward normal, weight, body.

    The weight of a sample that is not nearer than `depth` is 0, and so are its point and normal.
    `frames` (f j, 3, 4) are the moved frames of the joints, `palm` (3, 4) is the palm frame.
    """
    links, joints = frames.shape[0], chains.shape[1]
    pose = np.empty((links + 1, 3, 4))
    away = np.zeros(links + 1, dtype=np.bool_)
    for i in range(3):
        for j in range(4):
            pose[links, i, j] = palm[i, j]
            for body in range(links):
                pose[body, i, j] = frames[body, i, j]
    for body in range(links):
        row = chains[body // joints, body % joints]
        x, y, z, length = pose[body, 0, 3], pose[body, 1, 3], pose[body, 2, 3], 0.0
        for i in range(3):  # at the near end of the link's axis
            x += pose[body, 0, i] * row[1 + i]
            y += pose[body, 1, i] * row[1 + i]
            z += pose[body, 2, i] * row[1 + i]
            length += (row[4 + i] - row[1 + i]) ** 2
        reach = np.sqrt(length) + radii[body // joints, body % joints] + depth
        away[body] = field_distance(nodes, frame, x, y, z) > reach
    rows = np.zeros((samples.shape[0], 8))
    for m in range(samples.shape[0]):
        body = int(samples[m, 0])
        rows[m, 7] = body
        if away[body]:
            continue
        x, y, z = pose[body, 0, 3], pose[body, 1, 3], pose[body, 2, 3]
        u, v, w = 0.0, 0.0, 0.0
        for i in range(3):
            x += pose[body, 0, i] * samples[m, 1 + i]
            y += pose[body, 1, i] * samples[m, 1 + i]
            z += pose[body, 2, i] * samples[m, 1 + i]
            u += pose[body, 0, i] * samples[m, 4 + i]
            v += pose[body, 1, i] * samples[m, 4 + i]
            w += pose[body, 2, i] * samples[m, 4 + i]
        d = field_distance(nodes, frame, x, y, z)
        if d < depth:
            weight = min(1.0 - d / depth, 1.0) if graded else 1.0
            _put(rows, m, nodes, frame, x - skin * u, y - skin * v, z - skin * w, weight, body)
    return rows


def pass_share(gap: float, leave: float, depth: float) -> float:
    """Return by which share a pass of closest gap `gap`, that then leaves to `leave`, counts as a touch [m]."""
    return max(1.0 - max(gap, 0.0) / depth, 0.0) * min(max(4.0 * (leave - gap) / depth, 0.0), 1.0)


def blended(branches: Sequence[tuple[float, Array]]) -> Array:
    """Return the mixture (m, 8) of outcomes for the same skin samples: pairs of share and contacts (m, 8)."""
    shares = np.array([share for share, _ in branches])
    rows = np.stack([rows for _, rows in branches])
    weights = shares[:, None] * rows[:, :, 6]
    total = weights.sum(axis=0)
    safe = np.where(total > 0.0, total, 1.0)
    force = np.einsum("bm,bmi->mi", weights, rows[:, :, 3:6])
    size = np.sqrt(np.sum(force * force, axis=1))
    mixed = np.empty_like(rows[0])
    mixed[:, :3] = np.einsum("bm,bmi->mi", weights, rows[:, :, :3]) / safe[:, None]
    mixed[:, 3:6] = force / np.where(size > 0.0, size, 1.0)[:, None]
    mixed[:, 6], mixed[:, 7] = np.minimum(size, 1.0), rows[0, :, 7]
    return mixed


def as_contacts(rows: NDArray[np.float64], hand: Hand) -> Contacts:
    """Return the rows (c, 8) of the compiled functions as `Contacts`; rows of weight zero are left out."""
    rows = rows[rows[:, 6] > 0.0]
    bodies = rows[:, 7].astype(np.int64)
    names = tuple(hand.body_name(int(body)) for body in bodies)
    return Contacts(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), bodies, names)
