"""From a cleaned cloud to a belief: the side that was not seen, the prior shape, and the observations.

Mirror. Most things that are made to be held are about as deep behind their widest place as before it (Bohg and others
2011). Of the upright planes within 50 degrees of the view's, each is taken as near as the image allows: hardly more
than the least share of its mirrored points lie before the cloud or beside its outline, where they would have been seen;
these are left out. Where the cloud is nearly flat nothing tells the depth, and half of the shorter side is taken; what
is deeper than wide is not made deeper. The plane that makes the smallest whole is chosen.
Cloud and mirrored cloud make a surface, and that is the prior of another, which knows the cloud alone: how far a
mirrored side is off is a matter of experience (`SPREAD`, and `DRAWN` for whole shapes), not of the scatter of the
points.

Free. Between the camera and each point there was nothing, and beside the cloud's outline neither, also below a bottom
that was not seen: points there are bounds of the distance, by half of what the nearest point of the cloud, or the
outline, is away (the surface that was not seen may be nearer), `_FREE_REACH` at most.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.shape.belief import ShapeBelief, grid_of
from surehold.grasping.shape.implicit_surface import Observations, learnt_scales, surface_of
from surehold.grasping.shape.level_set import grid_around
from surehold.grasping.shape.point_cloud import PointCloud
from surehold.grasping.shape.prior import PRIORS, PriorShape

__all__ = ["DRAWN", "SPREAD", "Completed", "belief_of_cloud", "mirrored"]

Array = NDArray[np.float64]

#: Edge of a grid cell, in the longest edge of the box, and its bounds [m].
CELL: Final = (1.0 / 50.0, 0.002, 0.004)
#: Standard deviation and length scale of what a mirrored shape is off, in mean half extents of its box; chosen by
#: benchmarks/unknown_shapes.py on shapes that are not the shipped ones, hollow ones among them: a longer scale takes
#: what lies behind a wall that was seen for certain, though walls are thin.
SPREAD: Final = (0.4, 0.4)
#: The same of the process of which whole shapes are drawn. Draws of the one above have normals so far off that a hand
#: holds hardly any of them; this one is chosen by how near the mean quality on its draws comes to that on the true
#: shape, on the same shapes: benchmarks/unknown_shapes.py draws.
DRAWN: Final = (0.4, 3.0)
_BASE_POINTS: Final = 800  # of the cloud, of which the mirrored shape is made
_MIRROR_NOISE: Final = 0.003  # of a mirrored point [m]
_MOST_TURN: Final = 50.0  # between mirror plane and view [degrees]
_MOST_SLOPES: Final = 250
_SLOPE_NOISE: Final = 0.15  # of a normal's components
_SEEN: Final = 0.01
_FREE_REACH: Final = 0.010  # m
_BEYOND: Final = 0.020  # the box: so far points beside the outline are looked at; chosen on the same shapes [m]
_FREE_STEPS: Final = (0.004, 0.010, 0.020, 0.035, 0.060, 0.090)  # before a point of the cloud [m]


@dataclass(frozen=True, eq=False)
class Completed:
    """A cloud's mirrored side."""

    points: Array  #: (n, 3) m
    normals: Array  #: (n, 3)
    normal: Array  #: (3,) of the plane, away from the camera
    depth: float  #: of the plane along it [m]


def belief_of_cloud(
    cloud: PointCloud,
    prior: str = "mirror",
    *,
    name: str = "cloud",
    mass: float | None = None,
    friction: float = 0.5,
    cell: float | None = None,
    spread: tuple[float, float] = SPREAD,
    drawn: tuple[float, float] = DRAWN,
) -> ShapeBelief:
    """Return what a cloud says of a shape.

    Parameters
    ----------
    cloud
        As `cleaned` returns it.
    prior
        "mirror" (a box, with the cloud mirrored to its far side where the camera is known), "box" or "ellipsoid".
    name, mass, friction
        Of the object; the mass is that of water if not given [kg].
    cell
        Edge of the grid's cells [m]; a fiftieth of the longest edge, 2 to 4 mm, if not given.
    spread
        Standard deviation and length scale of what the mirrored shape may be off, in mean half extents.
    drawn
        The same of the process of which shapes are drawn.

    Raises
    ------
    InputError
        If the prior is unknown, or a length is not a positive number.
    """
    if prior not in PRIORS:
        raise unknown_name("prior shape", prior, PRIORS)
    if cell is not None and not (np.isfinite(cell) and cell > 0.0):
        raise InputError(f"grid cell is {cell!r}; give a positive length in meters, such as {CELL[2]:g}.")
    for name_of, pair in (("spread", spread), ("drawn", drawn)):
        if not (len(pair) == 2 and all(np.isfinite(number) and number > 0.0 for number in pair)):
            raise InputError(f"{name_of} is {pair!r}; give two positive numbers, such as {SPREAD}.")
    axes = _upright(cloud)
    other = mirrored(cloud, axes) if cloud.camera is not None else None
    everything = cloud.points
    if other is not None:
        everything = np.vstack([everything, other.points])
        axes = _smaller_box(everything, axes, other.normal)
    placed = everything @ axes
    lower, upper = placed.min(axis=0), placed.max(axis=0)
    if cloud.table is not None:  # the object stands on it
        lower[2] = min(lower[2], cloud.table.height)
    half = np.maximum(0.5 * (upper - lower), 0.004)
    box = PriorShape("ellipsoid" if prior == "ellipsoid" else "box", axes @ (0.5 * (lower + upper)), axes, half)
    told = _of_cloud(cloud)
    scales = learnt_scales(box, told)
    told = replace(told, noise=max(scales.noise, 1.0) * told.noise, free=free_points(cloud, box))
    shapes = None
    if prior == "mirror" and other is not None:
        size = float(np.exp(np.mean(np.log(half))))
        base = surface_of(box, _thin(told, _BASE_POINTS) + _of_mirror(other), scales.std, scales.length)
        surface, shapes = (surface_of(base, told, std * size, length * size) for std, length in (spread, drawn))
    else:
        surface = surface_of(box, told, scales.std, scales.length)
    fitting = min(max(CELL[0] * 2.0 * float(half.max()), CELL[1]), CELL[2])
    grid = grid_of(surface, cell or fitting)
    return ShapeBelief(surface, grid, name, mass, friction, seen_free(cloud, grid.nodes), shapes)


def seen_free(cloud: PointCloud, places: Array) -> Array:
    """Return those of places (p, 3) that the camera saw free, with the object's least distance there (b, 4) [m]."""
    from scipy.spatial import KDTree

    if cloud.camera is None:
        return np.empty((0, 4))
    free = places[_Image(cloud).contradicted(places)]
    return np.column_stack([free, np.minimum(0.5 * KDTree(cloud.points).query(free)[0], _FREE_REACH)])


def free_points(cloud: PointCloud, shape: PriorShape) -> Array:
    """Return points (b, 4) that the camera saw free, and the least distance of the object there [m]."""
    from scipy.spatial import KDTree

    rows = []
    if cloud.camera is not None:
        back = cloud.camera - cloud.points
        far = np.linalg.norm(back, axis=1)
        tree = KDTree(cloud.points)
        some = _spread(len(cloud.points), 1500)
        for step in _FREE_STEPS:
            mine = some[far[some] > step + 0.01]
            places = cloud.points[mine] + step * back[mine] / far[mine][:, None]
            gap = np.minimum(tree.query(places)[0], _FREE_REACH)
            rows.append(np.column_stack([places, 0.5 * gap]))
        inside = grid_around(-shape.half, shape.half, max(0.008, float(shape.half.max()) / 12.0), _BEYOND).nodes
        places = shape.center + inside @ shape.axes.T
        beside = _Image(cloud).beside(places)
        rows.append(np.column_stack([places, np.minimum(0.5 * beside, _FREE_REACH)])[beside > 0.0])
    if cloud.table is not None:
        n, h = cloud.table.normal, cloud.table.height
        foot = cloud.points - ((cloud.points @ n - h)[:, None] + 0.006) * n
        foot = foot[_spread(len(foot), 300)]
        rows.append(np.column_stack([foot, np.full(len(foot), 0.003)]))
    return np.vstack([np.empty((0, 4)), *rows])


def mirrored(cloud: PointCloud, axes: Array) -> Completed:
    """Return the cloud mirrored to the side that the camera did not see; `axes` (3, 3) are those of the object's box.

    The cloud's camera must be known.
    """
    points = cloud.points
    view = points.mean(axis=0) - np.asarray(cloud.camera)
    view = view / np.linalg.norm(view)
    up = axes[:, 2]
    level = view - (view @ up) * up
    # From steeply above, what is hidden is below rather than behind.
    straight = level / np.linalg.norm(level) if np.linalg.norm(level) > 0.5 else view
    side = np.cross(up, straight)
    image = _Image(cloud)
    found: list[tuple[float, Completed]] = []
    for angle in np.radians(np.arange(-_MOST_TURN, _MOST_TURN + 1.0, 10.0)):
        normal = np.cos(angle) * straight + np.sin(angle) * side
        turned, shown = _nearest_plane(cloud, normal, image)
        both = np.vstack([cloud.points, turned.points])
        volume = float(np.sqrt(np.linalg.det(np.cov(both.T))))
        found.append((volume / np.cos(angle) * (1.0 + 10.0 * shown), turned))
    return min(found, key=lambda pair: pair[0])[1]


def _nearest_plane(cloud: PointCloud, normal: Array, image: "_Image") -> tuple[Completed, float]:
    """Return the cloud mirrored at the nearest plane of that normal which the image allows, and the share it denies."""
    depth = cloud.points @ normal
    front, back = np.quantile(depth, [0.01, 0.99])
    across = cloud.points @ np.linalg.svd(normal[None])[2][1:].T
    sizes = np.sort(np.ptp(across, axis=0))
    start = front + (0.5 if back - front < 0.15 * sizes[0] else 0.1) * sizes[0]
    # What is seen to be deeper than wide is not made deeper still.
    farthest = front + 0.5 * max(back - front, float(sizes[1]))
    planes = np.arange(start, max(farthest, start) + 0.001, 0.002)
    turned = [cloud.points - 2.0 * (depth - plane)[:, None] * normal for plane in planes]
    seen = np.stack([image.contradicted(points) for points in turned])
    share = seen.mean(axis=1)
    nearest = int(np.argmax(share <= max(_SEEN, float(share.min()) + _SEEN)))
    hidden = ~seen[nearest]
    normals = cloud.normals - 2.0 * (cloud.normals @ normal)[:, None] * normal
    return Completed(turned[nearest][hidden], normals[hidden], normal, float(planes[nearest])), float(share[nearest])


class _Image:
    """The cloud as its camera saw it: by direction, how far the nearest point is."""

    def __init__(self, cloud: PointCloud):
        from scipy.spatial import KDTree

        self._camera = np.asarray(cloud.camera)
        self._unit, self._far = self._seen(cloud.points)
        self._tree = KDTree(self._unit)
        gaps = self._tree.query(self._unit, k=min(5, len(self._unit)))[0][:, -1]
        self._noise = float(np.median(cloud.noise))
        self._pixel = 1.5 * float(np.median(gaps))

    def _seen(self, points: Array) -> tuple[Array, Array]:
        ray = points - self._camera
        far = np.linalg.norm(ray, axis=1)
        return ray / far[:, None], far

    def beside(self, points: Array) -> Array:
        """Return how far points (n, 3) are beside the outline [m], 0 for those in it."""
        unit, far = self._seen(points)
        gap = self._tree.query(unit)[0]
        return np.where(gap > self._pixel, gap * far, 0.0)

    def contradicted(self, points: Array) -> NDArray[np.bool_]:
        """Return which of points (n, 3) would have been seen: those before the cloud, or beside its outline."""
        unit, far = self._seen(points)
        gap, nearest = self._tree.query(unit)
        beside = gap > self._pixel
        return beside | (far < self._far[nearest] - 0.002 - 2.0 * self._noise)


def _of_cloud(cloud: PointCloud) -> Observations:
    some = _spread(len(cloud.points), _MOST_SLOPES)
    slopes, places = cloud.normals[some], cloud.points[some]
    return Observations(
        cloud.points,
        np.zeros(len(cloud.points)),
        cloud.noise,
        places,
        slopes,
        np.full(len(some), _SLOPE_NOISE),
    )


def _of_mirror(other: Completed) -> Observations:
    some, few = _spread(len(other.points), 500), _spread(len(other.points), 150)
    return Observations(
        other.points[some],
        np.zeros(len(some)),
        np.full(len(some), _MIRROR_NOISE),
        other.points[few],
        other.normals[few],
        np.full(len(few), 2.0 * _SLOPE_NOISE),
    )


def _thin(told: Observations, most: int) -> Observations:
    """Return `most` of the values, fewer slopes, and all that is known free."""
    some, few = _spread(len(told.points), most), _spread(len(told.slopes), most // 5)
    return Observations(
        told.points[some],
        told.values[some],
        told.noise[some],
        told.slope_points[few],
        told.slopes[few],
        told.slope_noise[few],
        told.free,
    )


def _smaller_box(points: Array, axes: Array, normal: Array) -> Array:
    """Return the axes of the box, or those along the mirror plane where they make it smaller by a tenth or more."""
    z = axes[:, 2]
    y = normal - (normal @ z) * z
    if np.linalg.norm(y) < 0.5:
        return axes
    y = y / np.linalg.norm(y)
    turned = np.column_stack([np.cross(y, z), y, z])
    # Of the four quarter turns, the one nearest to the axes that were.
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = [turned @ np.linalg.matrix_power(quarter, k) for k in range(4)]
    turned = max(turns, key=lambda t: float(np.trace(axes.T @ t)))
    sizes = [float(np.prod(np.ptp(points @ a, axis=0))) for a in (axes, turned)]
    return turned if sizes[1] < 0.9 * sizes[0] else axes


def _upright(cloud: PointCloud) -> Array:
    """Return the axes (3, 3) of the object's box: the file's, turned so that z is off the table."""
    if cloud.table is None:
        return np.eye(3)
    z = cloud.table.normal
    x = np.eye(3)[int(np.argmin(np.abs(z)))] if abs(z[0]) > 0.9 else np.array([1.0, 0.0, 0.0])
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _spread(n: int, most: int) -> NDArray[np.int_]:
    """Return `most` numbers below n at equal steps, or all of them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))
