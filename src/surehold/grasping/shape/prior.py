"""What is thought of a shape before it was measured: the distance to a box or an ellipsoid.

x   point in the prior's own frame, m      e   half extents (3,), m      rho   radius of a box's edges, m
q   max(|x| - (e - rho), 0)                k0 = |x / e|, k1 = |x / e^2|

box        m(x) = |q| + min(max_i(|x_i| - e_i + rho), 0) - rho      the exact signed distance
ellipsoid  m(x) = k0 (k0 - 1) / k1                                 of first order: its slope is 1 on the surface

Edges are round because nothing that is held is sharper, and because a process cannot follow a crease.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["PRIORS", "PriorShape"]

Array = NDArray[np.float64]

#: Prior shapes by name; "mirror" is a box, and the cloud mirrored to the side that was not seen (completion.py).
PRIORS: Final = ("mirror", "box", "ellipsoid")


@dataclass(frozen=True, eq=False)
class PriorShape:
    """A box with round edges, or an ellipsoid, as a function with gradient and Hessian."""

    kind: str  #: "box" or "ellipsoid"
    center: Array  #: (3,) m
    axes: Array  #: (3, 3) its axes as columns
    half: Array  #: (3,) half extents along them [m]

    @property
    def rounding(self) -> float:
        """Radius of the box's edges [m]: a fifth of the shortest half edge, for nothing that is held is sharper."""
        return 0.2 * float(self.half.min())

    def value(self, points: Array) -> Array:
        """Return m (n,) at points (n, 3) [m], negative inside."""
        x = (points - self.center) @ self.axes
        if self.kind == "box":
            excess = np.abs(x) - self.half + self.rounding
            outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
            return outside + np.minimum(excess.max(axis=1), 0.0) - self.rounding
        k0, k1 = self._norms(x)
        return k0 * (k0 - 1.0) / k1

    def fast_value(self, points: Array) -> Array:
        """Return `value`: it is fast."""
        return self.value(points)

    def gradient(self, points: Array) -> Array:
        """Return the gradient (n, 3) of m at points (n, 3)."""
        x = (points - self.center) @ self.axes
        if self.kind == "box":
            excess = np.abs(x) - self.half + self.rounding
            q = np.maximum(excess, 0.0)
            size = np.linalg.norm(q, axis=1)
            nearest = np.eye(3)[np.argmax(excess, axis=1)]  # inside the core, the face that is nearest
            local = np.sign(x) * np.where(size[:, None] > 0.0, q / np.where(size > 0.0, size, 1.0)[:, None], nearest)
        else:
            k0, k1 = self._norms(x)
            g0, g1 = x / self.half**2 / k0[:, None], x / self.half**4 / k1[:, None]
            local = ((2.0 * k0 - 1.0) / k1)[:, None] * g0 - (k0 * (k0 - 1.0) / k1**2)[:, None] * g1
        return local @ self.axes.T

    def hessian(self, points: Array) -> Array:
        """Return the second derivatives (n, 3, 3) of m at points (n, 3) [1/m]; 0 where a box's face is nearest."""
        x = (points - self.center) @ self.axes
        if self.kind == "box":
            q = np.maximum(np.abs(x) - self.half + self.rounding, 0.0)
            size = np.linalg.norm(q, axis=1)
            safe = np.where(size > 0.0, size, 1.0)
            n = np.sign(x) * q / safe[:, None]
            local = ((q > 0.0)[:, :, None] * np.eye(3) - _outer(n, n)) / safe[:, None, None]
        else:
            k0, k1 = self._norms(x)
            d1, d2 = np.diag(1.0 / self.half**2), np.diag(1.0 / self.half**4)
            g0, g1 = x / self.half**2 / k0[:, None], x / self.half**4 / k1[:, None]
            k0, k1 = k0[:, None, None], k1[:, None, None]
            h0, h1 = (d1 - _outer(g0, g0)) / k0, (d2 - _outer(g1, g1)) / k1
            top = k0 * (k0 - 1.0)
            slope = (2.0 * k0[:, :, 0] - 1.0) * g0
            curvature = 2.0 * _outer(g0, g0) + (2.0 * k0 - 1.0) * h0
            local = (
                curvature / k1
                - (_outer(slope, g1) + _outer(g1, slope)) / k1**2
                + top * (2.0 * _outer(g1, g1) / k1**3 - h1 / k1**2)
            )
        return self.axes @ local @ self.axes.T

    def _norms(self, x: Array) -> tuple[Array, Array]:
        least = 1e-9  # the center, where the ellipsoid's distance is not defined
        k0, k1 = np.linalg.norm(x / self.half, axis=1), np.linalg.norm(x / self.half**2, axis=1)
        return np.maximum(k0, least), np.maximum(k1, least / float(self.half.max()))


def _outer(a: Array, b: Array) -> Array:
    return a[:, :, None] * b[:, None, :]
