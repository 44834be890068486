"""Forward kinematics of the fingers: joint frames and link axes from joint angles (compiled).

    f, j    fingers, joints of a finger       q     joint angles or shifts, (f, j), rad or m
    R, p    rotation and origin of a joint's frame; every joint turns about, or slides along, its own z axis

A joint and its link are a row of 19 numbers, `chain_row` in model.py.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["axis_ends", "finger_frames", "link_ends", "link_frames"]


@njit(cache=True)
def finger_frames(base, chain, q, frames):
    """Write the moved joint frames of one finger into frames (j, 3, 4).

    base (3, 4) is the frame of the first joint, chain (j, 19) its joints and links, q (j,) the joint angles or shifts.
    """
    for k in range(chain.shape[0]):
        for i in range(3):
            if k == 0:
                for n in range(4):
                    frames[0, i, n] = base[i, n]
            else:
                a, b, c = frames[k - 1, i, 0], frames[k - 1, i, 1], frames[k - 1, i, 2]
                row = chain[k - 1]
                for n in range(4):
                    frames[k, i, n] = a * row[7 + n] + b * row[11 + n] + c * row[15 + n]
                frames[k, i, 3] += frames[k - 1, i, 3]
        if chain[k, 0] > 0.0:
            for i in range(3):
                frames[k, i, 3] += q[k] * frames[k, i, 2]
        elif q[k] != 0.0:
            cos, sin = np.cos(q[k]), np.sin(q[k])
            for i in range(3):
                x, y = frames[k, i, 0], frames[k, i, 1]
                frames[k, i, 0] = cos * x + sin * y
                frames[k, i, 1] = cos * y - sin * x


@njit(cache=True)
def axis_ends(frames, chain, ends):
    """Write the ends of a finger's link axes into ends (j, 2, 3), from its frames (j, 3, 4)."""
    for k in range(chain.shape[0]):
        for i in range(3):
            x, y, z, p = frames[k, i, 0], frames[k, i, 1], frames[k, i, 2], frames[k, i, 3]
            ends[k, 0, i] = p + x * chain[k, 1] + y * chain[k, 2] + z * chain[k, 3]
            ends[k, 1, i] = p + x * chain[k, 4] + y * chain[k, 5] + z * chain[k, 6]


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
    joints = chains.shape[1]
    frames = np.empty((joints, 3, 4))
    ends = np.empty((chains.shape[0] * joints, 2, 3))
    for f in range(chains.shape[0]):
        finger_frames(bases[f], chains[f], angles[f], frames)
        axis_ends(frames, chains[f], ends[joints * f : joints * (f + 1)])
    return ends
