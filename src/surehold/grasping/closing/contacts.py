"""From a closed hand to contacts: points on the object, inward normals, weights (compiled).

    d       gap between a sample of the hand's skin and the object, m
    delta   depth of the soft touch, m
    w       weight of a contact, 1 - d / delta, in (0, 1]
    rho     thickness of the skin, m; m is a sample's outward normal on the hand, x its place

`single`   one contact for each link that touches: the point of the object nearest to the link. What is touched can
           switch from one side of an edge to the other, so the quality is rough in the pose.
`patch`    every skin sample within delta is a contact of full weight; on and off as samples enter and leave.
`graded`   every skin sample within delta is a contact of weight w: continuous in pose and joint angles, because
           a contact fades in and out. The skin is sampled at fixed places of each link and of the palm (hand/skin.py).

`graded` also feels what a link brushes past: see `Closed` in closing.py. A pass of gap g counts as a touch by the
share a = (1 - g / delta) min(1, 4 (l - g) / delta), with l the gap to which the link leaves again. Each sample is the
mixture of what it feels with the link held at the closest approach (share a) and with the link gone on (1 - a): the
contact force that is the weighted mean of both, at the weighted mean of both points. A hit fades into a miss.

Point and normal of a skin contact are those of the object's surface nearest to x - rho m, below the skin: bare x would
see the normal turn over at once where it passes a sharp edge, a skin of thickness rho rolls over it.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.closing.clearance import capsule_gap, piece_memory
from surehold.grasping.hand.model import Hand
from surehold.grasping.object.distance_field import field_distance, field_distance_gradient
from surehold.store.kernels import njit

__all__ = [
    "DEPTH",
    "GRADED",
    "PATCH",
    "SINGLE",
    "Contacts",
    "add_outcome",
    "as_contacts",
    "end_mixture",
    "pass_share",
    "skin_contacts",
    "touch_contacts",
]

Array = NDArray[np.float64]

DEPTH: Final = 0.006  #: depth of the soft touch, delta [m]: what is so near is reached as finger and object give way
SKIN: Final = 0.002  #: thickness of the skin, rho [m]
_SUNK: Final = 1e-4  # what is as deep in the object is within it, not at its surface [m]
_STEPS: Final = 24  # in which the way from a sample back to the axis of its link is looked at
GRADED, PATCH, SINGLE = range(3)  #: the contact models as the compiled functions take them


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a grasp, in the frame of the object."""

    #: (c, 3) on the object's surface [m]; "graded", of a link that passed something, the mean of two places of it
    points: NDArray[np.float64] = field(repr=False)
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
def _through(nodes, frame, pose, row, place, x, y, z):
    """Tell whether a sample at x, y, z, at `place` (3,) of its link, feels a surface from behind, through the object.

    Flat links stop where the capsules within them touch, and their corners may stand out by more than a wall is thick.
    `row` is the link's of its chain, `pose` (3, 4) the moved frame.
    """
    share, square = 0.0, 0.0
    for i in range(3):
        along = row[4 + i] - row[1 + i]
        share += (place[i] - row[1 + i]) * along
        square += along * along
    share = min(max(share / square, 0.0), 1.0) if square > 0.0 else 0.0
    u, v, w = 0.0, 0.0, 0.0  # from the nearest point of the link's axis
    for i in range(3):
        out = place[i] - row[1 + i] - share * (row[4 + i] - row[1 + i])
        u += pose[0, i] * out
        v += pose[1, i] * out
        w += pose[2, i] * out
    _, gx, gy, gz = field_distance_gradient(nodes, frame, x, y, z)
    if gx * u + gy * v + gz * w <= 0.0:
        return False
    for k in range(_STEPS + 1):
        t = k / _STEPS
        if field_distance(nodes, frame, x - t * u, y - t * v, z - t * w) < -_SUNK:
            return True
    return False


@njit(cache=True)
def touch_contacts(nodes, frame, ends, touched, radii):
    """Return one contact (c, 8) for each link that touched: point, inward normal, weight 1, body."""
    rows = np.empty((touched.size, 8))
    n = 0
    for body in range(touched.size):
        if touched[body]:
            near, far = ends[body, 0], ends[body, 1]
            radius = radii[body // radii.shape[1], body % radii.shape[1]]
            s = capsule_gap(nodes, frame, near, far, radius, 1e-7, 0.0, piece_memory())[1]
            p = near + s * (far - near)
            n = _put(rows, n, nodes, frame, p[0], p[1], p[2], 1.0, body)
    return rows[:n]


@njit(cache=True)
def skin_contacts(nodes, frame, frames, chains, radii, palm, samples, depth, graded, first, last):
    """Return contacts (m, 8) of all skin samples (m, 7): point, inward normal, weight, body.

    The weight of a sample that is not nearer than `depth` is 0, and so are its point and normal; so is all of a sample
    of a body that is not from `first` to before `last`.
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
    for body in range(max(first, 0), min(last, links)):
        row = chains[body // joints, body % joints]
        x, y, z, length = pose[body, 0, 3], pose[body, 1, 3], pose[body, 2, 3], 0.0
        for i in range(3):  # at the near end of the link's axis
            x += pose[body, 0, i] * row[1 + i]
            y += pose[body, 1, i] * row[1 + i]
            z += pose[body, 2, i] * row[1 + i]
            length += (row[4 + i] - row[1 + i]) ** 2
        reach = np.sqrt(length) + 1.75 * radii[body // joints, body % joints] + depth  # corners of a box: sqrt(3) radii
        away[body] = field_distance(nodes, frame, x, y, z) > reach
    rows = np.zeros((samples.shape[0], 8))
    for m in range(samples.shape[0]):
        body = int(samples[m, 0])
        if not first <= body < last:
            continue
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
            if body < links:
                row = chains[body // joints, body % joints]
                if _through(nodes, frame, pose[body], row, samples[m, 1:4], x, y, z):
                    continue
            weight = min(1.0 - d / depth, 1.0) if graded else 1.0
            _put(rows, m, nodes, frame, x - SKIN * u, y - SKIN * v, z - SKIN * w, weight, body)
    return rows


@njit(cache=True)
def pass_share(gap, leave, depth):
    """Return by which share a pass of closest gap `gap`, that then leaves to `leave`, counts as a touch [m]."""
    return max(1.0 - max(gap, 0.0) / depth, 0.0) * min(max(4.0 * (leave - gap) / depth, 0.0), 1.0)


@njit(cache=True)
def add_outcome(mixture, rows, share, first, last):
    """Add an outcome's contacts, rows (m, 8), to a mixture (m, 8), for the samples of bodies `first` to before `last`.

    A mixture begins with zeros and sums points, forces and weights, each times weight and share; `end_mixture` ends it.
    """
    for m in range(len(rows)):
        if first <= rows[m, 7] < last:
            weight = share * rows[m, 6]
            for i in range(6):
                mixture[m, i] += weight * rows[m, i]
            mixture[m, 6] += weight


@njit(cache=True)
def end_mixture(mixture, rows, first, last):
    """Write the mean force at the mean place to `rows` (m, 8), for the samples of bodies `first` to before `last`."""
    for m in range(len(rows)):
        if not first <= rows[m, 7] < last:
            continue
        square = mixture[m, 3] ** 2 + mixture[m, 4] ** 2 + mixture[m, 5] ** 2
        size = np.sqrt(square)
        for i in range(3):
            rows[m, i] = mixture[m, i] / mixture[m, 6] if mixture[m, 6] > 0.0 else 0.0
            rows[m, 3 + i] = mixture[m, 3 + i] / size if size > 0.0 else 0.0
        rows[m, 6] = min(size, 1.0)


def as_contacts(rows: NDArray[np.float64], hand: Hand) -> Contacts:
    """Return the rows (c, 8) of the compiled functions as `Contacts`; rows of weight zero are left out."""
    rows = rows[rows[:, 6] > 0.0]
    bodies = rows[:, 7].astype(np.int64)
    names = tuple(map(hand.body_names.__getitem__, bodies.tolist()))
    return Contacts(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), bodies, names)
