"""A point cloud made ready to learn a shape from: cleaned, thinned, with normals and noise.

In this order: points that are not finite, or in the camera, are dropped; of many an even part is taken, so that what
follows costs the same for ten million; the unit is checked; a table under the object is found and taken off; points far
from their neighbors are dropped, and groups of a few points that lie apart; a second object is refused; the rest is
thinned to cubes of equal size, whose means have less noise; the noise is measured as the scatter about local planes.
Distances to neighbors are those of SciPy's k-d tree.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["MOST_POINTS", "PointCloud", "Table", "cleaned"]

Array = NDArray[np.float64]

MOST_POINTS: Final = 2500  #: from which a surface is learnt; more are thinned to it: dense algebra costs their cube
_MOST_READ: Final = 60_000  # points that are looked at; of more, as many in each cube of a grid
_AT_ONCE: Final = 1_000_000  # points that are put into cubes at once
# Edges of these cubes in the extent of the points: finer than a part, but so wide that few hold only a noise's tails.
_CUBES: Final = 24
_LEAST_POINTS: Final = 20
_LARGEST, _SMALLEST = 0.6, 0.005  # extent of what a hand can grasp [m]
_NEIGHBORS: Final = 12
_LEAST_NOISE: Final = 0.0003  # of a thinned point [m]
_APART: Final = 0.012  # gap between two objects [m]
_INWARD: Final = 0.3  # of what all of them would be: less is a thin wall, of which both sides are seen
_NEAREST, _FARTHEST = 0.01, 10.0  # of a camera that sees an object of a hand's size [m]


@dataclass(frozen=True, eq=False)
class Table:
    """The plane on which the object stands: normal . x = height."""

    normal: Array  #: (3,) unit length, towards the object
    height: float  #: m


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of an object's surface, in meters."""

    points: Array = field(repr=False)  #: (n, 3)
    normals: Array = field(repr=False)  #: (n, 3) unit length, outward
    noise: Array = field(repr=False)  #: (n,) standard deviation along the normal [m]
    camera: Array | None = None  #: (3,)
    table: Table | None = None
    notes: tuple[str, ...] = ()  #: what was found and done, one sentence each


def cleaned(
    points: Array,
    normals: Array | None = None,
    camera: Array | None = None,
    noise: float | None = None,
    most: int = MOST_POINTS,
) -> PointCloud:
    """Return a cloud that a shape can be learnt from.

    Parameters
    ----------
    points
        (n, 3) m; rows that are not finite are dropped.
    normals
        (n, 3) of any length; estimated from neighbors if not given. Their sign is set towards the camera if that is
        known; else, of estimated ones, away from the middle of the cloud, and given ones that point to it are refused.
    camera
        (3,) m, where the cloud was seen from.
    noise
        Standard deviation of a point [m]; measured as the scatter about local planes if not given.
    most
        Points that are kept.

    Raises
    ------
    InputError
        If too few points are left, they lie on a line, the unit is wrong, there are two objects, the normals point
        inwards, or a number is out of range.
    """
    if camera is not None and not (np.shape(camera) == (3,) and np.all(np.isfinite(camera))):
        raise InputError(f"camera is {camera!r}; give three finite numbers, where the cloud was seen from [m].")
    if noise is not None and not (np.isfinite(noise) and noise >= 0.0):
        raise InputError(f"noise of the points is {noise!r}; give a standard deviation of 0 m or more, such as 0.001.")
    if most < _LEAST_POINTS:
        raise InputError(f"most is {most!r}; keep {_LEAST_POINTS} points or more, such as {MOST_POINTS:,}.")
    notes: list[str] = []
    if normals is not None:
        points = np.column_stack([points, normals])
    finite = np.all(np.isfinite(points), axis=1)
    if not np.all(finite):
        notes.append(f"{int(np.sum(~finite)):,} of {len(points):,} points are not finite and were left out")
        points = points[finite]
    if camera is not None:
        empty = np.linalg.norm(points[:, :3] - camera, axis=1) < 1e-6
        if np.any(empty):  # as depth cameras write pixels without a distance
            notes.append(f"{int(np.sum(empty)):,} points lie in the camera and were left out")
            points = points[~empty]
    _enough(points, "finite ")
    if len(points) > _MOST_READ:
        count, points = len(points), _even_part(points)
        notes.append(f"of {count:,} points {len(points):,} were taken, evenly")
    points = _without_twins(points)
    _enough(points, "different ")
    _check_unit(points[:, :3])
    table, kept = _table(points[:, :3], camera)
    if table is not None:
        notes.append(f"a table of {int(np.sum(~kept)):,} points was taken off")
        points = points[kept]
        _enough(points, "table aside, ")
    points = _largest_object(points, camera, notes)
    _enough(points, "clean ")
    size = np.ptp(points[:, :3], axis=0)
    if camera is not None:
        inside = np.all((camera > points[:, :3].min(axis=0)) & (camera < points[:, :3].max(axis=0)))
        away = float(np.linalg.norm(points[:, :3] - camera, axis=1).min())
        if inside or away < _NEAREST:
            raise InputError(
                f"the camera {np.round(camera, 4).tolist()} m lies among the points of the object; give where it "
                "stood, in the file's unit and frame, or leave it out."
            )
        if away > _FARTHEST:
            notes.append(f"the camera is {away:,.0f} m away: give it in the unit and frame of the file")
    spread = np.linalg.svd(points[:, :3] - points[:, :3].mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if spread[1] < max(0.02 * spread[0], 0.0005):
        raise InputError(
            f"the cloud's {len(points):,} points lie on a line of {1e3 * np.linalg.norm(size):.0f} mm; a surface is "
            "needed: check the columns of the file, or turn the camera."
        )
    place, outward, scatter = _planes(points[:, :3], camera)
    if normals is not None:
        given = points[:, 3:] / np.maximum(np.linalg.norm(points[:, 3:], axis=1), 1e-12)[:, None]
        # A normal of length zero says nothing: the estimated one stands for it.
        outward = np.where(np.linalg.norm(points[:, 3:], axis=1)[:, None] > 1e-6, given, outward)
        if camera is not None:
            outward *= np.where(np.sum(outward * (camera - place), axis=1) < 0.0, -1.0, 1.0)[:, None]
        else:
            _check_outward(place, outward)
    sigma = float(np.median(scatter)) if noise is None else float(noise)
    place, outward, count = _thinned(place, outward, most)
    if len(place) < len(points):
        notes.append(f"{len(points):,} points were thinned to {len(place):,}")
    each = np.maximum(sigma / np.sqrt(count), _LEAST_NOISE)
    notes.append(f"noise {1e3 * sigma:.1f} mm" + ("" if noise is not None else ", measured"))
    if camera is None:
        notes.append("the camera is not known: give --camera x,y,z, so that what it saw free counts")
    return PointCloud(place, outward, each, camera, table, tuple(notes))


def _enough(points: Array, kind: str) -> None:
    if len(points) < _LEAST_POINTS:
        raise InputError(
            f"the cloud has {len(points)} {kind}points; give {_LEAST_POINTS} or more of the object's surface."
        )


def _check_unit(points: Array) -> None:
    low, high = np.quantile(points, [0.02, 0.98], axis=0)
    size = float((high - low).max())
    if not _SMALLEST <= size <= 4.0:
        spans = f"{size:.3g} m" if size > 4.0 else f"{1e3 * size:.3g} mm"
        raise InputError(f"the cloud spans {spans}; give the unit of its numbers: --unit mm, cm, m or in.")


def _check_outward(points: Array, normals: Array) -> None:
    """Refuse normals that point inwards: the inside would be learnt as the outside, and a larger object.

    By the divergence theorem the mean of normal . point is three volumes by the area of a closed surface. A hollow that
    is seen from its opening looks the same; there the camera tells.
    """
    along = np.sum(normals * (points - points.mean(axis=0)), axis=1)
    if along.mean() < -_INWARD * np.abs(along).mean():
        raise InputError(
            f"{100.0 * float(np.mean(along < 0.0)):.0f} % of the normals point to the middle of the cloud; turn them "
            "outwards, leave --normals out, or give --camera x,y,z, towards which they are turned."
        )


def _even_part(points: Array) -> Array:
    """Return about `_MOST_READ` of the points, all of those of sparse places and as many of each of the dense ones."""
    low, high = np.quantile(points[:: len(points) // _MOST_READ, :3], [0.01, 0.99], axis=0)
    edge = max(float((high - low).max()) / _CUBES, 1e-9)
    side = _CUBES + 32  # with room on both sides; what lies farther out counts to the outermost cubes
    parts = []
    for start in range(0, len(points), _AT_ONCE):
        steps = np.floor((points[start : start + _AT_ONCE, :3] - low) / edge) + 16.0
        i, j, k = np.clip(steps, 0, side - 1).astype(np.int32).T
        parts.append((i * side + j) * side + k)
    cube = np.concatenate(parts)
    count = np.bincount(cube)
    ordered = np.sort(count[count > 0])
    before = np.cumsum(ordered) - ordered
    left = len(ordered) - np.arange(len(ordered))  # cubes that hold as many or more
    k = int(np.searchsorted(before + left * ordered, _MOST_READ))
    most = (_MOST_READ - before[k]) / left[k]  # of a cube
    return points[np.random.default_rng(0).random(len(points)) < most / count[cube]]


def _without_twins(points: Array) -> Array:
    """Return the points without exact repetitions, in their order."""
    _, first = np.unique(points[:, :3], axis=0, return_index=True)
    return points[np.sort(first)]


def _table(points: Array, camera: Array | None) -> tuple[Table | None, NDArray[np.bool_]]:
    """Return the plane under the object, or None, and which points are not of it.

    A table is a plane with at least a fifth of the points, hardly any point beyond it, and more than 1.6 times as wide
    as what stands on it, both ways: the face of a box is not.
    """
    everything = np.ones(len(points), dtype=bool)
    rng = np.random.default_rng(0)
    some = points[rng.choice(len(points), min(len(points), 3000), replace=False)]
    best, count, thick = None, 0, 0.004
    for _ in range(300):
        a, b, c = some[rng.choice(len(some), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length < 1e-8:
            continue
        normal = normal / length
        inliers = int(np.sum(np.abs((some - a) @ normal) < thick))
        if inliers > count:
            best, count = (normal, a), inliers
    if best is None or count < 0.2 * len(some):
        return None, everything
    normal, a = best
    near = np.abs((points - a) @ normal) < thick
    middle = points[near].mean(axis=0)
    normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][2]
    height = (points - middle) @ normal
    up = np.sum(height[np.abs(height) > thick]) if camera is None else (camera - middle) @ normal
    normal, height = (normal, height) if up >= 0.0 else (-normal, -height)
    thick = max(thick, 3.0 * float(np.std(height[np.abs(height) < thick])))
    above = height > thick
    if np.sum(above) < _LEAST_POINTS or np.sum(height < -thick) > 0.02 * len(points):
        return None, everything
    basis = np.linalg.svd(normal[None])[2][1:]

    def width(rows: Array) -> Array:
        return np.ptp(np.quantile(rows @ basis.T, [0.02, 0.98], axis=0), axis=0)

    if np.any(width(points[~above]) < 1.6 * width(points[above])):
        return None, everything
    return Table(normal, float(middle @ normal)), above


def _largest_object(points: Array, camera: Array | None, notes: list[str]) -> Array:
    """Return the points without outliers and small groups.

    A part that hides another tears a cloud apart, but not the camera's image of it: groups are of one object if they
    lie beside each other as the camera sees them, and not farther apart than the larger is long: the hand that carries
    the camera is. What is less than half as far from the camera as the object is left out.

    Raises
    ------
    InputError
        If a second group is a fifth as large as the first, or larger, and lies apart; if the first is less than half as
        far from the camera as a second, as the hand that carries it is; or if what is left is too large to be grasped.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    tree = KDTree(points[:, :3])
    gaps = tree.query(points[:, :3], k=min(9, len(points)))[0][:, 1:].mean(axis=1)
    usual = float(np.median(gaps))
    good = gaps < 4.0 * usual
    if not np.all(good):
        notes.append(f"{int(np.sum(~good)):,} outliers were left out")
        points = points[good]
        tree = KDTree(points[:, :3])
    near = max(_APART if len(points) < 20_000 else 0.003, 4.0 * usual)  # fewer pairs of a dense cloud
    pairs = tree.query_pairs(near, output_type="ndarray")
    ones = np.ones(len(pairs))
    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, group = connected_components(graph, directed=False)
    sizes = np.bincount(group)
    order = np.argsort(-sizes, kind="stable")
    largest = group == order[0]
    seen, far = points[:, :3], np.ones(len(points))
    if camera is not None:  # moved along their rays to one distance
        ray = seen - camera
        far = np.linalg.norm(ray, axis=1)
        seen = ray * (np.median(far) / far)[:, None]
    first, place = KDTree(seen[largest]), KDTree(points[largest, :3])
    extent = float(np.ptp(points[largest, :3], axis=0).max())
    kept, carried = largest.copy(), np.zeros(len(points), dtype=bool)
    for number in order[1:]:
        mine = group == number
        gap, way = (float(tree.query(rows[mine])[0].min()) for tree, rows in ((first, seen), (place, points[:, :3])))
        if gap < _APART and way < extent:
            kept |= mine
        elif far[mine].max() < 0.5 * far[largest].min():
            carried |= mine
        elif far[largest].max() < 0.5 * far[mine].min() and sizes[number] >= 0.05 * sizes[order[0]]:
            raise InputError(
                f"{np.sum(largest):,} points within {1e3 * far[largest].max():.0f} mm of the camera stand before "
                f"{sizes[number]:,} others; take out those of the hand that carries the camera, or give one object."
            )
        elif sizes[number] >= 0.2 * sizes[order[0]]:
            raise InputError(
                f"the cloud holds two objects of {sizes[order[0]]:,} and {sizes[number]:,} points, {1e3 * way:.0f} mm "
                "apart; give one of them, without the hand's own points."
            )
    if np.any(carried):
        reach = 1e3 * far[carried].max()
        notes.append(f"{np.sum(carried):,} points within {reach:.0f} mm of the camera, as of a hand, were left out")
    if not np.all(kept | carried):
        notes.append(f"{np.sum(~kept & ~carried):,} points apart from the object were left out")
    points = points[kept]
    size = float(np.ptp(points[:, :3], axis=0).max())
    if size > _LARGEST:
        raise InputError(
            f"the object spans {1e3 * size:.0f} mm, too much for a hand; give the cloud of one object, or its --unit."
        )
    return points


def _planes(points: Array, camera: Array | None) -> tuple[Array, Array, Array]:
    """Return the points, outward normals (n, 3) and the scatter (n,) about the plane of the nearest neighbors [m]."""
    from scipy.spatial import KDTree

    k = min(_NEIGHBORS + 1, len(points))
    # Of dense clouds the neighbors are taken from a thinned one: noise must not be wider than what it is measured over.
    near = KDTree(points).query(points, k=k)[1]
    local = points[near]  # (n, k, 3)
    middle = local.mean(axis=1, keepdims=True)
    spread = np.einsum("nki,nkj->nij", local - middle, local - middle) / (k - 3.0)
    values, vectors = np.linalg.eigh(spread)
    outward = vectors[:, :, 0]
    towards = camera - points if camera is not None else points - points.mean(axis=0)
    outward = outward * np.where(np.sum(outward * towards, axis=1) < 0.0, -1.0, 1.0)[:, None]
    return points, outward, np.sqrt(np.maximum(values[:, 0], 0.0))


def _thinned(points: Array, normals: Array, most: int) -> tuple[Array, Array, Array]:
    """Return means of the points and normals in cubes, `most` of them or fewer, and how many points each stands for."""
    edge = 0.0
    size = float(np.ptp(points, axis=0).max())
    where = np.arange(len(points))
    while where.max() + 1 > most:
        edge = 1.15 * edge if edge else size / 400.0
        where = np.unique(np.floor(points / edge).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(where)
    mean = np.column_stack([np.bincount(where, weights=points[:, i]) for i in range(3)]) / count[:, None]
    turned = np.column_stack([np.bincount(where, weights=normals[:, i]) for i in range(3)])
    length = np.linalg.norm(turned, axis=1)
    return mean, turned / np.where(length > 0.0, length, 1.0)[:, None], count.astype(np.float64)
