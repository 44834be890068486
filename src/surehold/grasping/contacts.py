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
from numba import njit
from numpy.typing import NDArray

from surehold.grasping.clearance import capsule_gap
from surehold.grasping.closing import link_ends
from surehold.grasping.distance_field import field_distance, field_distance_gradient
from surehold.grasping.hand import PALM, Hand, link_name

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
DEPTH: Final = 0.003  #: depth of the soft touch, delta [m]
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
    bodies: NDArray[np.int64] = field(repr=False)  #: (c,) number of the touching body, 4 finger + link; the palm is 20

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the touching body of each contact, such as "thumb distal" or "palm"."""
        return tuple(link_name(int(body)) for body in self.bodies)

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
def touch_contacts(nodes, frame, ends, touched, radius):
    """Return one contact (c, 8) for each link that touched: point, inward normal, weight 1, body."""
    rows = np.empty((20, 8))
    n = 0
    for body in range(20):
        if touched[body]:
            near, far = ends[body, 0], ends[body, 1]
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
    """Return skin samples (m, 6) of the flat inner face of the palm, in its box's frame: place and outward normal."""
    reach = half[:2] - rounding
    u, v = (r * np.linspace(-1.0, 1.0, int(np.ceil(2.0 * r / PALM_PITCH)) + 1) for r in reach)
    place = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    n = len(place)
    return np.column_stack([place, np.full(n, half[2]), np.zeros((n, 2)), np.ones(n)])


def skin_samples(hand: Hand) -> Array:
    """Return all skin samples (m, 7) of a hand: number of the body; place [m] and outward normal in its frame.

    The frame of a link has its origin at the near end and z along the link, that of the palm is its box's.
    """
    lengths = np.linalg.norm(
        np.diff(link_ends(hand.bases, hand.chains, 0.5 * (hand.lower + hand.upper)), axis=1), axis=2
    )
    parts = [link_samples(hand.radius, float(lengths[body, 0]), body % 4 == 3) for body in range(PALM)]
    parts.append(palm_samples(hand.palm_half_extents, hand.palm_rounding))
    return np.vstack([np.column_stack([np.full(len(part), body), part]) for body, part in enumerate(parts)])


@njit(cache=True)
def skin_contacts(nodes, frame, ends, sides, radius, palm, samples, depth, skin, graded):
    """Return contacts (m, 8) of all skin samples (m, 7): point, inward normal, weight, body.

    The weight of a sample that is not nearer than `depth` is 0, and so are its point and normal.
    `sides` (5, 3) is the bending axis of each finger: the x axis of its links' frames is it, without its part along z.
    """
    pose = np.empty((21, 3, 4))
    away = np.zeros(21, dtype=np.bool_)
    for i in range(3):
        for j in range(4):
            pose[PALM, i, j] = palm[i, j]
    for body in range(PALM):
        length, lean, size = 0.0, 0.0, 0.0
        for i in range(3):
            pose[body, i, 3] = ends[body, 0, i]
            pose[body, i, 2] = ends[body, 1, i] - ends[body, 0, i]
            length += pose[body, i, 2] ** 2
        length = np.sqrt(length)
        for i in range(3):
            pose[body, i, 2] /= length
            lean += pose[body, i, 2] * sides[body // 4, i]
        for i in range(3):
            pose[body, i, 0] = sides[body // 4, i] - lean * pose[body, i, 2]
            size += pose[body, i, 0] ** 2
        size = np.sqrt(size)
        for i in range(3):
            pose[body, i, 0] /= size
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            pose[body, i, 1] = pose[body, j, 2] * pose[body, k, 0] - pose[body, k, 2] * pose[body, j, 0]
        x, y, z = (pose[body, 0, 3], pose[body, 1, 3], pose[body, 2, 3])
        away[body] = field_distance(nodes, frame, x, y, z) > length + radius + depth
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


def as_contacts(rows: NDArray[np.float64]) -> Contacts:
    """Return the rows (c, 8) of the compiled functions as `Contacts`; rows of weight zero are left out."""
    rows = rows[rows[:, 6] > 0.0]
    return Contacts(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), rows[:, 7].astype(np.int64))
