"""Round friction cones as ellipsoids of wrenches (compiled); notation as in friction_cones.py."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.store.kernels import njit

__all__ = ["RoundCones", "ellipsoids", "tangent_field"]

# The tangent field below is singular at -_POLE alone. The pole is in general position: faces, chamfers at 45 degrees
# and barrels of objects modeled along their axes keep clear of it.
_POLE: Final = (0.36, 0.48, 0.8)
_POLE_TANGENT: Final = (0.8, -0.6, 0.0)


class RoundCones(NamedTuple):
    """Friction of all contacts of a grasp, and how torques are measured."""

    friction: float  #: coefficient
    torsion: float  #: by the torque length
    divisor: float  #: of forces: 1, or what makes those of the cone's rim unit
    torque_length: float  #: [m]
    origin: NDArray[np.float64]  #: (3,) of torques [m]


@njit(cache=True)
def tangent_field(normals):
    """Return a unit tangent for each unit normal, (c, 3): the pole's, carried along by the smallest rotation."""
    out = np.empty(normals.shape)
    for i in range(len(normals)):
        closeness, along = 1.0, 0.0
        for k in range(3):
            closeness += normals[i, k] * _POLE[k]
            along += normals[i, k] * _POLE_TANGENT[k]
        factor = along / (closeness if closeness > 1e-14 else 1.0)
        rest = 0.0
        for k in range(3):
            out[i, k] = _POLE_TANGENT[k] - factor * (normals[i, k] + _POLE[k])
            rest += out[i, k] * normals[i, k]
        square = 0.0
        for k in range(3):
            out[i, k] -= rest * normals[i, k]
            square += out[i, k] * out[i, k]
        length = np.sqrt(square)
        for k in range(3):
            out[i, k] /= length
    return out


@njit(cache=True)
def ellipsoids(normals, tangents, arms, friction, torsion, scale):
    """Return centers (c, 6) and axes (c, 6, 3) of contacts: unit normals and tangents (c, 3), arms (p - o) / L (c, 3).

    `friction`, `torsion` (divided by L) and `scale` are (c,).
    """
    c = len(normals)
    centers, axes = np.empty((c, 6)), np.zeros((c, 6, 3))
    for i in range(c):
        n, t, r = normals[i], tangents[i], arms[i]
        b0, b1, b2 = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        _wrench(scale[i], n[0], n[1], n[2], r, centers[i])
        _wrench(friction[i] * scale[i], t[0], t[1], t[2], r, axes[i, :, 0])
        _wrench(friction[i] * scale[i], b0, b1, b2, r, axes[i, :, 1])
        for k in range(3):
            axes[i, 3 + k, 2] = torsion[i] * scale[i] * n[k]
    return centers, axes


@njit(cache=True)
def _wrench(length, x, y, z, arm, out):
    """Write the wrench of a force of some length and direction x, y, z at an arm (3,) to out (6,)."""
    x, y, z = length * x, length * y, length * z
    out[0], out[1], out[2] = x, y, z
    out[3], out[4], out[5] = arm[1] * z - arm[2] * y, arm[2] * x - arm[0] * z, arm[0] * y - arm[1] * x
