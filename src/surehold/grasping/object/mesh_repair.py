"""The solid that a mesh means: what is mended, what is said of it, and what is refused.

A mesh is refused if it is not a solid of a size that a hand can meet: without triangles, not finite, open over more
than `MOST_OPEN` of its area, with faces that disagree about what is outside, flat, below 5 mm or above 2 m.

Mended, each with a note: vertices at the same place become one; triangles without area, and triangles given twice, are
left out; single triangles that are inside out among others are turned; holes are closed by a fan about the middle of
their border; of the closed bodies that the mesh consists of, those that are inside out are turned; bodies that touch or
overlap become their union (manifold3d), so that no space counts twice. A body that is inside out within another one is
a cavity and stays one.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["MOST_OPEN", "UNITS", "repaired"]

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}  #: name of a unit -> meters
MOST_OPEN: Final = 0.1  #: area of all holes by area of the surface, from which on a mesh is no solid
_SMALLEST, _LARGEST = 0.005, 2.0  # of the longest edge of the box [m]
_FLATTEST = 2e-4  # shortest edge of the box [m]
_MOST_BODIES = 500  # of which each is compared with each


class _Holes(NamedTuple):
    twisted_edges: int  # edges whose faces disagree about what is outside
    start: Faces  # (e,) edges with a face on one side only: from this vertex
    end: Faces  # (e,) to this one
    label: Faces  # (e,) which border an edge belongs to
    areas: Array  # (borders,) m^2


def repaired(name: str, vertices: Array, faces: Faces, unit: str) -> tuple[Array, Faces, list[str]]:
    """Return vertices (v, 3) [m] and faces (f, 3) of the solid, counterclockwise from outside, and the notes.

    Raises
    ------
    InputError
        If the mesh is refused as said above; `name` and `unit` are what the message calls it and its unit.
    """
    import trimesh

    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{name!r} has triangles whose corners are not there (it has {len(vertices)} vertices).")
    used, renumbered = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], renumbered.reshape(faces.shape)
    if not np.all(np.isfinite(vertices)):
        raise InputError(f"{name!r} has coordinates that are not finite; repair the mesh.")
    size = np.ptp(vertices, axis=0)
    numbers = (f"{1e3 * s:,.0f}" if 10.0 <= s < 1e6 else f"{1e3 * s:.4g}" for s in size)
    shown = f"{' x '.join(numbers)} mm in unit {unit}"
    if size.max() < _SMALLEST or size.max() > _LARGEST:
        fitting = [u for u, meters in UNITS.items() if 0.02 <= size.max() / UNITS[unit] * meters <= 0.5]
        guess = f"; is its unit {' or '.join(fitting)}?" if fitting else "."
        raise InputError(
            f"{name!r} is {shown}, too {'small' if size.max() < _SMALLEST else 'large'} for a hand "
            f"({1e3 * _SMALLEST:g} mm to {1e3 * _LARGEST:g} mm){guess}"
        )
    notes: list[str] = []
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=8)
    vertices, faces, area = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64), np.array(mesh.area_faces)
    flat = (area <= 5e-17) | np.any(faces == np.roll(faces, 1, axis=1), axis=1)
    if np.all(flat):
        raise InputError(f"{name!r} is degenerate: none of its {len(faces):,} triangles has an area ({shown}).")
    if np.any(flat):
        notes.append(f"{np.sum(flat):,} triangles without area are left out")
        faces, area = faces[~flat], area[~flat]
    if size.min() < _FLATTEST:
        raise InputError(f"{name!r} is flat ({shown}); give the surface of a solid.")
    single = _single(faces)
    if len(single) < len(faces):
        notes.append(f"{len(faces) - len(single):,} doubled triangles are left out")
        faces, area = faces[single], area[single]
    holes = _holes(vertices, faces)
    if holes.twisted_edges > 0.02 * len(faces):
        raise InputError(
            f"{name!r} ({shown}) has {holes.twisted_edges:,} edges whose two faces disagree about what is outside; "
            "make the normals consistent in your modeling program."
        )
    if holes.twisted_edges:
        faces, turned = _consistent(faces)
        if turned:
            notes.append(f"{turned:,} triangle{'s were' if turned > 1 else ' was'} inside out among others and turned")
        holes = _holes(vertices, faces)
    share, count = float(holes.areas.sum() / area.sum()), len(holes.areas)
    many = f"{count:,} hole{'s' * (count > 1)}"
    if share > MOST_OPEN:
        raise InputError(f"{name!r} ({shown}) is an open surface: {many} of {100 * share:.0f} % of its area; close it.")
    if count:
        vertices, faces = _filled(vertices, faces, holes)
        notes.append(f"not watertight: {many}, the largest of {1e6 * holes.areas.max():.2g} mm^2, closed")
    vertices, faces = _one_solid(vertices, faces, notes)
    return vertices, faces, notes


def _single(faces: Faces) -> Faces:
    """Return the indices of the faces without those given twice.

    Two that lie back to back are the walls of two bodies that touch, and both go, unless all are back to back.
    """
    first = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    once = np.sort(np.unique(turned, axis=0, return_index=True)[1])
    _, where, count = np.unique(np.sort(faces[once], axis=1), axis=0, return_inverse=True, return_counts=True)
    alone = once[count[where.ravel()] == 1]
    if len(alone):
        return alone
    return once[np.unique(where.ravel(), return_index=True)[1]]


def _consistent(faces: Faces) -> tuple[Faces, int]:
    """Return the faces, of those that hang together over edges of two the minority turned, and how many were turned.

    Each face stands in a graph as it is and turned over; two faces of an edge hang together where they run along it in
    opposite directions. A part falls into two then: how it is, and turned over as a whole.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    m = len(faces)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key = edges.min(axis=1) * (int(faces.max()) + 1) + edges.max(axis=1)
    order = np.argsort(key, kind="stable")
    start = np.flatnonzero(np.r_[True, np.diff(key[order]) > 0])
    pairs = start[np.diff(np.r_[start, len(key)]) == 2]
    one, other = order[pairs], order[pairs + 1]
    twisted = edges[one, 0] == edges[other, 0]
    a, b = one // 3, other // 3 + m * twisted
    rows, columns = np.r_[a, a + m], np.r_[b, np.where(twisted, b - m, b + m)]
    label = connected_components(coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * m, 2 * m)), False)[1]
    kept = np.bincount(label[:m], minlength=label.max() + 1)
    same, over = label[:m], label[m:]
    turned = (kept[same] < kept[over]) | ((kept[same] == kept[over]) & (same > over))
    return np.where(turned[:, None], faces[:, ::-1], faces), int(np.sum(turned))


def _holes(vertices: Array, faces: Faces) -> _Holes:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = len(vertices)
    forward, counts = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    backward = (forward % n) * n + forward // n
    place = np.minimum(np.searchsorted(forward, backward), len(forward) - 1)
    against = np.where(forward[place] == backward, counts[place], 0)
    twisted = int(np.sum(np.maximum(counts - np.maximum(against, 1), 0)))
    # An edge without partner is on a border; twice in the same direction, its faces disagree instead.
    border = forward[(against == 0) & (counts == 1)]
    a, b = border // n, border % n
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    label = connected_components(graph, directed=False)[1][a]
    _, label = np.unique(label, return_inverse=True)
    middle = vertices.mean(axis=0)
    spans = 0.5 * np.cross(vertices[a] - middle, vertices[b] - middle)
    sums = [np.bincount(label, weights=spans[:, i]) for i in range(3)]
    return _Holes(twisted, a, b, label, np.linalg.norm(sums, axis=0))  # vector areas: exact for a plane hole


def _filled(vertices: Array, faces: Faces, holes: _Holes) -> tuple[Array, Faces]:
    """Return the mesh with a fan of triangles over each border, about the mean of its vertices."""
    count = np.bincount(holes.label)[:, None]
    sums = np.column_stack([np.bincount(holes.label, weights=vertices[holes.start, i]) for i in range(3)])
    fan = np.column_stack([holes.end, holes.start, len(vertices) + holes.label])
    return np.vstack([vertices, sums / count]), np.vstack([faces, fan])


def _one_solid(vertices: Array, faces: Faces, notes: list[str]) -> tuple[Array, Faces]:
    """Return the mesh with its bodies turned to the outside and, where they touch or overlap, united."""
    from scipy.sparse.csgraph import connected_components
    from trimesh.triangles import mass_properties

    bodies = _bodies(faces)
    volumes = np.array([float(mass_properties(vertices[faces[body]], skip_inertia=True)["volume"]) for body in bodies])
    if len(bodies) == 1 or len(bodies) > _MOST_BODIES:
        if volumes.sum() < 0.0:
            notes.append("it was inside out and is turned")
            faces = np.ascontiguousarray(faces[:, ::-1])
        return vertices, faces
    solids = [_solid(vertices, faces[body], turn=v < 0.0) for body, v in zip(bodies, volumes, strict=True)]
    boxes = np.array([(vertices[faces[b]].min(axis=(0, 1)), vertices[faces[b]].max(axis=(0, 1))) for b in bodies])
    within = _within(solids, boxes)
    outward = volumes > 0.0
    turned = np.zeros(len(bodies), dtype=bool)
    for i in np.argsort(-np.abs(volumes)):  # a body is larger than what is within it
        if not np.any(within[i]) and not outward[i]:
            mine = within[:, i].copy()
            mine[i] = True
            outward[mine] = ~outward[mine]  # with what is within it
            turned |= mine
    for i in np.flatnonzero(turned):
        faces[bodies[i]] = faces[bodies[i]][:, ::-1]
    if np.all(turned):
        notes.append("it was inside out and is turned")
    elif np.any(turned):
        notes.append(
            f"{turned.sum()} of its {len(bodies)} bodies {'was' if turned.sum() == 1 else 'were'} inside out "
            f"and {'is' if turned.sum() == 1 else 'are'} turned"
        )
    near = np.all(boxes[:, None, 0] <= boxes[None, :, 1] + 1e-8, axis=2)
    near &= near.T & outward[:, None] & outward[None, :] & ~np.eye(len(bodies), dtype=bool)
    apart = connected_components(near[np.ix_(outward, outward)], directed=False)[0]
    if apart > 1:
        notes.append(f"{apart} bodies that do not touch are taken as one rigid object")
    if not np.any(near) or any(solid is None for solid in solids):
        return vertices, faces
    return _united(solids, outward, vertices, faces, notes)


def _united(
    solids: list[Any], outward: NDArray[np.bool_], vertices: Array, faces: Faces, notes: list[str]
) -> tuple[Array, Faces]:
    import manifold3d

    add = manifold3d.OpType.Add
    whole = manifold3d.Manifold.batch_boolean([s for s, out in zip(solids, outward, strict=True) if out], add)
    summed = sum(s.volume() for s, out in zip(solids, outward, strict=True) if out)
    shared = summed - whole.volume()
    hollow = [s for s, out in zip(solids, outward, strict=True) if not out]
    if hollow:
        whole -= manifold3d.Manifold.batch_boolean(hollow, add)
    mesh = whole.to_mesh64()
    united = np.array(mesh.vert_properties)[:, :3].copy(), np.asarray(mesh.tri_verts, dtype=np.int64)
    if shared > 1e-6 * summed:
        notes.append(f"its {outward.sum()} bodies overlap by {1e6 * shared:.3g} ml, which count once")
        return united
    return united if len(whole.decompose()) < len(solids) else (vertices, faces)


def _bodies(faces: Faces) -> list[NDArray[np.intp]]:
    """Return the faces of each closed body: those that hang together over edges of two faces.

    Parts that are not closed by themselves, because their border is an edge of more than two faces, are taken
    together with the parts beyond that edge.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    m = len(faces)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    start = np.flatnonzero(np.r_[True, np.diff(key[order]) > 0])
    count = np.diff(np.r_[start, len(key)])
    owner = order // 3
    pairs = start[count == 2]
    links = [(owner[pairs], owner[pairs + 1])]

    def parts() -> NDArray[np.int_]:
        a, b = (np.concatenate([link[k] for link in links]) for k in (0, 1))
        return np.asarray(connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(m, m)), False)[1])

    label = parts()
    for first, n in zip(start[count > 2], count[count > 2], strict=True):
        here = owner[first : first + n]
        if np.any(np.bincount(np.unique(label[here], return_inverse=True)[1]) % 2):
            links.append((here[:-1], here[1:]))
    label = parts()
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _solid(vertices: Array, faces: Faces, turn: bool) -> Any:
    """Return a body as a `manifold3d.Manifold` with its volume inside, or None if its surface is not closed."""
    import manifold3d

    used, where = np.unique(faces[:, ::-1] if turn else faces, return_inverse=True)
    corners = np.ascontiguousarray(where.reshape(-1, 3), dtype=np.uint64)
    solid = manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices[used]), corners))
    return solid if solid.status() == manifold3d.Error.NoError and solid.volume() > 0.0 else None


def _within(solids: list[Any], boxes: Array) -> NDArray[np.bool_]:
    """Return (n, n): whether the body of the row lies within the body of the column."""
    n = len(solids)
    inside = np.all(boxes[:, None, 0] >= boxes[None, :, 0], axis=2)
    inside &= np.all(boxes[:, None, 1] <= boxes[None, :, 1], axis=2) & ~np.eye(n, dtype=bool)
    for i, j in zip(*np.nonzero(inside), strict=True):
        a, b = solids[i], solids[j]
        inside[i, j] = a is not None and b is not None and (a - b).volume() < 1e-6 * a.volume()
    return inside
