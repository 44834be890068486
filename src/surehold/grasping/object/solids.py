"""Solids with an exact distance: revolved profiles, bent bars and boxes, and unions of them.

    x    a point, (3,), m                    d(x)   signed distance, m: negative inside, positive outside
    g    gradient of d, unit length, (3,)    c(x)   the closest point of the surface, c = x - d g

Each solid gives its signed distance in closed form and a watertight triangle mesh of itself, so that a shipped object
and its distance field come from the same numbers. In a union the distance is exact outside; inside, where two solids
overlap, it is the larger of the two depths, a lower bound of the true depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["RevolvedProfile", "RoundedBox", "Solid", "Tube", "signed_distance", "triangles"]

_MILLIMETER = 1e-3
_CHORDS = 128  #: facets around a full turn; a circle of 40 mm radius is then met within 0.012 mm

Array = NDArray[np.float64]


class Solid(Protocol):
    """A closed body with an exact signed distance and a mesh."""

    def signed_distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) and its gradient (n, 3) at points (n, 3) [m]."""
        ...

    def bounding_ball(self) -> tuple[Array, float]:
        """Return center (3,) and radius [m] of a ball that holds the solid."""
        ...

    def manifold(self) -> Any:
        """Return the solid as a `manifold3d.Manifold` in millimeters."""
        ...


@dataclass(frozen=True)
class RevolvedProfile:
    """A polygon in the half plane (radius, height), grown by a rounding, and turned about an axis."""

    profile: tuple[tuple[float, float], ...]  #: corners (radius >= 0, height) [m], counterclockwise
    rounding: float  #: by how much the polygon is grown: the radius of its convex corners [m]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: where radius and height are zero [m]
    axis: str = "z"  #: the axis of revolution: "x" or "z"

    def signed_distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) and its gradient (n, 3) at points (n, 3) [m]."""
        local = points - np.asarray(self.origin)
        if self.axis == "x":
            local = np.roll(local, -1, axis=1)  # (x, y, z) -> (y, z, x): a rotation
        radius = np.hypot(local[:, 0], local[:, 1])
        distance, gradient = self._in_plane(radius, local[:, 2])
        distance -= self.rounding
        safe = np.where(radius > 0.0, radius, 1.0)
        outward = np.where(radius > 0.0, gradient[:, 0], 0.0)
        g = np.column_stack([outward * local[:, 0] / safe, outward * local[:, 1] / safe, gradient[:, 1]])
        return distance, np.roll(g, 1, axis=1) if self.axis == "x" else g

    def bounding_ball(self) -> tuple[Array, float]:
        """Return center (3,) and radius [m] of a ball that holds the solid."""
        corners = np.asarray(self.profile)
        middle = 0.5 * (corners[:, 1].min() + corners[:, 1].max())
        along = np.eye(3)[0 if self.axis == "x" else 2]
        radius = float(np.hypot(corners[:, 0], corners[:, 1] - middle).max()) + self.rounding
        return np.asarray(self.origin) + middle * along, radius

    def _in_plane(self, r: Array, z: Array) -> tuple[Array, Array]:
        corners = np.asarray(self.profile)
        best = np.full(r.shape, np.inf)
        nearest = np.zeros((r.size, 2))
        inside = np.zeros(r.shape, dtype=bool)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            crosses = (a[1] > z) != (b[1] > z)
            if a[1] != b[1]:
                inside ^= crosses & (r < (b[0] - a[0]) * (z - a[1]) / (b[1] - a[1]) + a[0])
            if a[0] == 0.0 and b[0] == 0.0:
                continue  # an edge on the axis is no surface
            edge = b - a
            along = np.clip(((r - a[0]) * edge[0] + (z - a[1]) * edge[1]) / (edge @ edge), 0.0, 1.0)
            foot = a + along[:, None] * edge
            squared = (r - foot[:, 0]) ** 2 + (z - foot[:, 1]) ** 2
            closer = squared < best
            best[closer] = squared[closer]
            nearest[closer] = foot[closer]
        distance = np.sqrt(best)
        sign = np.where(inside, -1.0, 1.0)
        safe = np.where(distance > 0.0, distance, 1.0)
        away = np.column_stack([r, z]) - nearest
        return sign * distance, (sign / safe)[:, None] * away

    def manifold(self) -> Any:
        """Return the solid as a `manifold3d.Manifold` in millimeters."""
        import manifold3d

        core = manifold3d.CrossSection([np.asarray(self.profile) / _MILLIMETER])
        whole = core.offset(self.rounding / _MILLIMETER, manifold3d.JoinType.Round, circular_segments=48)
        body = manifold3d.Manifold.revolve(whole, _CHORDS)  # what the growth put beyond the axis is cut off
        if self.axis == "x":
            body = body.rotate([0.0, 90.0, 0.0])
        return body.translate((np.asarray(self.origin) / _MILLIMETER).tolist())


@dataclass(frozen=True)
class Tube:
    """All points within `radius` of a polyline: a bent round bar with round ends."""

    centerline: tuple[tuple[float, float, float], ...]  #: corners of the polyline [m]
    radius: float  #: m

    def signed_distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) and its gradient (n, 3) at points (n, 3) [m]."""
        corners = np.asarray(self.centerline)
        best = np.full(len(points), np.inf)
        away = np.zeros_like(points)
        for a, b in pairwise(corners):
            edge = b - a
            from_a = points - a
            along = np.clip(from_a @ edge / (edge @ edge), 0.0, 1.0)
            gap = from_a - along[:, None] * edge
            squared = np.einsum("ij,ij->i", gap, gap)
            closer = squared < best
            best[closer] = squared[closer]
            away[closer] = gap[closer]
        distance = np.sqrt(best)
        return distance - self.radius, away / np.where(distance > 0.0, distance, 1.0)[:, None]

    def bounding_ball(self) -> tuple[Array, float]:
        """Return center (3,) and radius [m] of a ball that holds the solid."""
        corners = np.asarray(self.centerline)
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        return center, float(np.linalg.norm(corners - center, axis=1).max()) + self.radius

    def manifold(self) -> Any:
        """Return the solid as a `manifold3d.Manifold` in millimeters."""
        import manifold3d

        ball = manifold3d.Manifold.sphere(self.radius / _MILLIMETER, 64)
        balls = [ball.translate((np.asarray(c) / _MILLIMETER).tolist()) for c in self.centerline]
        bars = [manifold3d.Manifold.batch_hull([a, b]) for a, b in pairwise(balls)]
        return manifold3d.Manifold.batch_boolean(bars, manifold3d.OpType.Add)


@dataclass(frozen=True)
class RoundedBox:
    """A box whose edges are rounded, turned about the y axis through its center."""

    center: tuple[float, float, float]  #: m
    half_extents: tuple[float, float, float]  #: half edge lengths, rounding included [m]
    rounding: float  #: radius of edges and corners [m]
    tilt: float = 0.0  #: turn about +y [rad]

    def signed_distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) and its gradient (n, 3) at points (n, 3) [m]."""
        turn = self._turn()
        local = (points - np.asarray(self.center)) @ turn
        core = np.asarray(self.half_extents) - self.rounding
        over = np.abs(local) - core
        out = np.maximum(over, 0.0)
        outside = np.linalg.norm(out, axis=1)
        deepest = np.argmax(over, axis=1)
        g = out / np.where(outside > 0.0, outside, 1.0)[:, None]
        within = outside == 0.0
        g[within] = np.eye(3)[deepest[within]]
        distance = np.where(within, over[np.arange(len(over)), deepest], outside) - self.rounding
        return distance, (g * np.where(local < 0.0, -1.0, 1.0)) @ turn.T

    def bounding_ball(self) -> tuple[Array, float]:
        """Return center (3,) and radius [m] of a ball that holds the solid."""
        return np.asarray(self.center), float(np.linalg.norm(self.half_extents))

    def _turn(self) -> Array:
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    def manifold(self) -> Any:
        """Return the solid as a `manifold3d.Manifold` in millimeters."""
        import manifold3d

        ball = manifold3d.Manifold.sphere(self.rounding / _MILLIMETER, 64)
        core = (np.asarray(self.half_extents) - self.rounding) / _MILLIMETER
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        body = manifold3d.Manifold.batch_hull([ball.translate((core * s).tolist()) for s in signs])
        turned = body.rotate([0.0, float(np.degrees(self.tilt)), 0.0])
        return turned.translate((np.asarray(self.center) / _MILLIMETER).tolist())


def signed_distance(solids: Sequence[Solid], points: Array) -> tuple[Array, Array]:
    """Return the signed distance (n,) of the union of the solids and its gradient (n, 3) at points (n, 3) [m]."""
    distance, gradient = solids[0].signed_distance(points)
    for solid in solids[1:]:
        center, radius = solid.bounding_ball()
        near = np.flatnonzero(np.linalg.norm(points - center, axis=1) - radius < distance)
        d, g = solid.signed_distance(points[near])
        closer = d < distance[near]
        distance[near[closer]] = d[closer]
        gradient[near[closer]] = g[closer]
    return distance, gradient


def triangles(solids: Sequence[Solid]) -> tuple[Array, NDArray[np.int32], float, Array]:
    """Return the union as a watertight mesh: vertices (v, 3) [m], faces (f, 3), volume [m^3], center of volume (3,)."""
    import manifold3d
    import trimesh

    body = manifold3d.Manifold.batch_boolean([solid.manifold() for solid in solids], manifold3d.OpType.Add)
    mesh = body.simplify(1e-4).to_mesh64()
    vertices = np.ascontiguousarray(np.asarray(mesh.vert_properties)[:, :3]) * _MILLIMETER
    faces = np.ascontiguousarray(mesh.tri_verts, dtype=np.int32)
    solid = trimesh.Trimesh(vertices, faces, process=False)
    return vertices, faces, float(solid.volume), np.asarray(solid.center_mass)
