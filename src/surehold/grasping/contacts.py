"""From a closed hand to contacts: points on the object, inward normals, weights (compiled).

    d       gap between a sample of the hand's skin and the object, m
    delta   depth of the soft touch, m
    w       weight of a contact, 1 - d / delta, in (0, 1]

`single`   one contact for each link that touches: the point of the object nearest to the link. What is touched can
           switch from one side of an edge to the other, so the quality is rough in the pose.
`patch`    every skin sample within delta is a contact of full weight; on and off as samples enter and leave.
`graded`   every skin sample within delta is a contact of weight w: continuous in pose and joint angles, because
           a contact fades in and out. The skin is sampled at fixed places of each link and of the palm.
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
    """Write the contact below the point x, y, z into row n: point (3), inward normal (3), weight, body."""
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
def skin_contacts(nodes, frame, ends, sides, radius, palm, half, rounding, depth, stations, around, pitch, graded):
    """Return contacts (c, 8) of all skin samples nearer than `depth`: point, inward normal, weight, body.

    `sides` (5, 3) is the bending axis of each finger: the samples of a ring are counted from it.
    """
    n1 = int(np.ceil(2.0 * half[0] / pitch)) + 1
    n2 = int(np.ceil(2.0 * half[1] / pitch)) + 1
    rows = np.empty((20 * (stations * around + 1) + n1 * n2, 8))
    n = 0
    normal, third = np.empty(3), np.empty(3)
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
            normal[i] = side[i] - lean * axis[i]
            size += normal[i] ** 2
        for i in range(3):
            normal[i] /= np.sqrt(size)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            third[i] = (axis[j] * normal[k] - axis[k] * normal[j]) / length
        # One ring at each of the stations; the distal link's round end has one more sample, its tip.
        for s in range(stations):
            share = (s + 0.5) / stations
            for a in range(around):
                angle = 2.0 * np.pi * a / around
                c, e = radius * np.cos(angle), radius * np.sin(angle)
                x = near[0] + share * axis[0] + c * normal[0] + e * third[0]
                y = near[1] + share * axis[1] + c * normal[1] + e * third[1]
                z = near[2] + share * axis[2] + c * normal[2] + e * third[2]
                d = field_distance(nodes, frame, x, y, z)
                if d < depth:
                    weight = min(1.0 - d / depth, 1.0) if graded else 1.0
                    n = _put(rows, n, nodes, frame, x, y, z, weight, body)
        if body % 4 == 3:
            x = far[0] + radius / length * axis[0]
            y = far[1] + radius / length * axis[1]
            z = far[2] + radius / length * axis[2]
            d = field_distance(nodes, frame, x, y, z)
            if d < depth:
                weight = min(1.0 - d / depth, 1.0) if graded else 1.0
                n = _put(rows, n, nodes, frame, x, y, z, weight, body)
    # The palm: the flat part of its inner face.
    h1, h2 = half[0] - rounding, half[1] - rounding
    for i in range(n1):
        u = h1 * (2.0 * i / (n1 - 1) - 1.0)
        for j in range(n2):
            v = h2 * (2.0 * j / (n2 - 1) - 1.0)
            x = palm[0, 3] + u * palm[0, 0] + v * palm[0, 1] + half[2] * palm[0, 2]
            y = palm[1, 3] + u * palm[1, 0] + v * palm[1, 1] + half[2] * palm[1, 2]
            z = palm[2, 3] + u * palm[2, 0] + v * palm[2, 1] + half[2] * palm[2, 2]
            d = field_distance(nodes, frame, x, y, z)
            if d < depth:
                weight = min(1.0 - d / depth, 1.0) if graded else 1.0
                n = _put(rows, n, nodes, frame, x, y, z, weight, PALM)
    return rows[:n]


def as_contacts(rows: NDArray[np.float64]) -> Contacts:
    """Return the rows (c, 8) of the compiled functions as `Contacts`."""
    return Contacts(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), rows[:, 7].astype(np.int64))
