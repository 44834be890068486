"""Forward kinematics of the fingers: joint frames and link axes from joint angles (compiled).

    f, j    fingers, joints of a finger       q     joint angles or shifts, (f, j), rad or m
    x, y, z, p   axes and origin of a joint's frame; every joint turns about, or slides along, its own z axis

A joint and its link are a row of 19 numbers, `chain_row` in model.py.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["axis_ends", "finger_frames", "frame_columns", "link_ends", "link_frames", "moved_joint", "next_joint"]


@njit(cache=True)
def frame_columns(frame):
    """Return x, y, z and p of a frame (3, 4), as triples: they stay in registers."""
    return (
        (frame[0, 0], frame[1, 0], frame[2, 0]),
        (frame[0, 1], frame[1, 1], frame[2, 1]),
        (frame[0, 2], frame[1, 2], frame[2, 2]),
        (frame[0, 3], frame[1, 3], frame[2, 3]),
    )


@njit(cache=True)
def next_joint(row, x, y, z, p):
    """Return the frame of the joint after the one whose moved frame is x, y, z, p and whose row is `row` (19,)."""
    q = _turned(row, 3, x, y, z)
    return _turned(row, 0, x, y, z), _turned(row, 1, x, y, z), _turned(row, 2, x, y, z), _plus(p, 1.0, q)


@njit(cache=True)
def moved_joint(row, q, x, y, z, p):
    """Return x, y and p of a joint's frame, of row `row` (19,), moved by q; z stays."""
    if row[0] > 0.0:
        return x, y, _plus(p, q, z)
    if q == 0.0:
        return x, y, p
    c, s = np.cos(q), np.sin(q)
    return (
        (c * x[0] + s * y[0], c * x[1] + s * y[1], c * x[2] + s * y[2]),
        (c * y[0] - s * x[0], c * y[1] - s * x[1], c * y[2] - s * x[2]),
        p,
    )


@njit(cache=True)
def _turned(row, n, x, y, z):
    """Return column n of the offset in `row`, turned into the frame."""
    a, b, c = row[7 + n], row[11 + n], row[15 + n]
    return a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2]


@njit(cache=True)
def _plus(p, q, z):
    return p[0] + q * z[0], p[1] + q * z[1], p[2] + q * z[2]


@njit(cache=True)
def finger_frames(base, chain, q, frames):
    """Write the moved joint frames of one finger into frames (j, 3, 4).

    base (3, 4) is the frame of the first joint, chain (j, 19) its joints and links, q (j,) the joint angles or shifts.
    """
    x, y, z, p = frame_columns(base)
    for k in range(chain.shape[0]):
        if k > 0:
            x, y, z, p = next_joint(chain[k - 1], x, y, z, p)
        x, y, p = moved_joint(chain[k], q[k], x, y, z, p)
        for i in range(3):
            frames[k, i, 0], frames[k, i, 1], frames[k, i, 2], frames[k, i, 3] = x[i], y[i], z[i], p[i]


@njit(cache=True)
def axis_ends(row, x, y, z, p, ends):
    """Write the ends of a link's axis, of row `row` (19,), into ends (2, 3)."""
    for i in range(3):
        ends[0, i] = p[i] + x[i] * row[1] + y[i] * row[2] + z[i] * row[3]
        ends[1, i] = p[i] + x[i] * row[4] + y[i] * row[5] + z[i] * row[6]


@njit(cache=True)
def link_frames(bases, chains, angles):
    """Return the moved frames of all joints (f j, 3, 4) at joint angles (f, j)."""
    joints = chains.shape[1]
    frames = np.empty((chains.shape[0] * joints, 3, 4))
    for f in range(chains.shape[0]):
        finger_frames(bases[f], chains[f], angles[f], frames[joints * f : joints * (f + 1)])
    return frames


@njit(cache=True)
def link_ends(bases, chains, angles):
    """Return the ends of all link axes (f j, 2, 3) at joint angles (f, j)."""
    frames = link_frames(bases, chains, angles)
    ends = np.empty((len(frames), 2, 3))
    for b in range(len(frames)):
        x, y, z, p = frame_columns(frames[b])
        axis_ends(chains[b // chains.shape[1], b % chains.shape[1]], x, y, z, p, ends[b])
    return ends
