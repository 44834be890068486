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

Point and normal of a skin contact are those of the object's surface nearest to x - rho m, below the skin: bare x would
see the normal turn over at once where it passes a sharp edge, a skin of thickness rho rolls over it.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from surehold.grasping.clearance import capsule_gap
from surehold.grasping.distance_field import field_distance, field_distance_gradient
from surehold.grasping.hand import PALM, link_name

__all__ = ["CONTACT_MODELS", "DEPTH", "Contacts", "as_contacts", "skin_contacts", "touch_contacts"]

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


@njit(cache=True)
def link_samples(radius, length, round_end, stations, around):
    """Return skin samples (m, 6) of a link along z: place, outward normal. `round_end` adds the far end's half ball.

    A ring of `around` samples at the middle of each of `stations` equal pieces; on the half ball two rings and the tip.
    """
    rows = np.empty((stations * around + (around + around // 2 + 1 if round_end else 0), 6))
    n = 0
    for s in range(stations + (3 if round_end else 0)):
        latitude = 0.0 if s < stations else np.pi / 6.0 * (s - stations + 1)
        height = length * (s + 0.5) / stations if s < stations else length
        count = around if latitude < 0.9 else (around // 2 if latitude < 1.3 else 1)
        for a in range(count):
            angle = 2.0 * np.pi * a / count
            rows[n, 3] = np.cos(latitude) * np.cos(angle)
            rows[n, 4] = np.cos(latitude) * np.sin(angle)
            rows[n, 5] = np.sin(latitude)
            rows[n, 0], rows[n, 1] = radius * rows[n, 3], radius * rows[n, 4]
            rows[n, 2] = height + radius * rows[n, 5]
            n += 1
    return rows


@njit(cache=True)
def palm_samples(half, rounding, pitch):
    """Return skin samples (m, 6) of the flat inner face of the palm, in its box's frame: place and outward normal."""
    n1 = int(np.ceil(2.0 * (half[0] - rounding) / pitch)) + 1
    n2 = int(np.ceil(2.0 * (half[1] - rounding) / pitch)) + 1
    rows = np.zeros((n1 * n2, 6))
    for i in range(n1):
        for j in range(n2):
            row = rows[i * n2 + j]
            row[0] = (half[0] - rounding) * (2.0 * i / (n1 - 1) - 1.0)
            row[1] = (half[1] - rounding) * (2.0 * j / (n2 - 1) - 1.0)
            row[2], row[5] = half[2], 1.0
    return rows


@njit(cache=True)
def _skin(rows, n, nodes, frame, pose, samples, depth, skin, graded, body):
    """Add the contacts of one body's samples; `pose` (3, 4) carries them to the object's frame."""
    for i in range(samples.shape[0]):
        s = samples[i]
        x = pose[0, 0] * s[0] + pose[0, 1] * s[1] + pose[0, 2] * s[2] + pose[0, 3]
        y = pose[1, 0] * s[0] + pose[1, 1] * s[1] + pose[1, 2] * s[2] + pose[1, 3]
        z = pose[2, 0] * s[0] + pose[2, 1] * s[1] + pose[2, 2] * s[2] + pose[2, 3]
        d = field_distance(nodes, frame, x, y, z)
        if d < depth:
            x -= skin * (pose[0, 0] * s[3] + pose[0, 1] * s[4] + pose[0, 2] * s[5])
            y -= skin * (pose[1, 0] * s[3] + pose[1, 1] * s[4] + pose[1, 2] * s[5])
            z -= skin * (pose[2, 0] * s[3] + pose[2, 1] * s[4] + pose[2, 2] * s[5])
            weight = min(1.0 - d / depth, 1.0) if graded else 1.0
            n = _put(rows, n, nodes, frame, x, y, z, weight, body)
    return n


@njit(cache=True)
def skin_contacts(
    nodes, frame, ends, sides, radius, palm, half, rounding, depth, skin, stations, around, pitch, graded
):
    """Return contacts (c, 8) of all skin samples nearer than `depth`: point, inward normal, weight, body.

    `sides` (5, 3) is the bending axis of each finger: the samples of a ring are counted from it.
    """
    flat = palm_samples(half, rounding, pitch)
    rows = np.empty((20 * (stations + 2) * around + flat.shape[0], 8))
    pose = np.empty((3, 4))
    n = 0
    for body in range(20):
        near, far = ends[body, 0], ends[body, 1]
        axis = far - near
        length = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
        middle = 0.5 * (near + far)
        if field_distance(nodes, frame, middle[0], middle[1], middle[2]) > 0.5 * length + radius + depth:
            continue
        side = sides[body // 4]
        lean = (side[0] * axis[0] + side[1] * axis[1] + side[2] * axis[2]) / length**2
        size = 0.0
        for i in range(3):
            pose[i, 0] = side[i] - lean * axis[i]
            size += pose[i, 0] ** 2
            pose[i, 2] = axis[i] / length
            pose[i, 3] = near[i]
        for i in range(3):
            pose[i, 0] /= np.sqrt(size)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            pose[i, 1] = pose[j, 2] * pose[k, 0] - pose[k, 2] * pose[j, 0]
        samples = link_samples(radius, length, body % 4 == 3, stations, around)
        n = _skin(rows, n, nodes, frame, pose, samples, depth, skin, graded, body)
    n = _skin(rows, n, nodes, frame, palm, flat, depth, skin, graded, PALM)
    return rows[:n]


def as_contacts(rows: NDArray[np.float64]) -> Contacts:
    """Return the rows (c, 8) of the compiled functions as `Contacts`."""
    return Contacts(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), rows[:, 7].astype(np.int64))
