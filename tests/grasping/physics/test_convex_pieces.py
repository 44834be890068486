import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surehold.errors import InputError
from surehold.grasping import OBJECTS, shipped_object
from surehold.grasping.object.solids import signed_distance
from surehold.grasping.physics.convex_pieces import convex_pieces


@pytest.mark.parametrize("name", OBJECTS)
def test_pieces_fill_the_object_and_hardly_stand_out(name):
    obj = shipped_object(name)
    pieces = convex_pieces(obj.vertices, obj.faces)
    hulls = [ConvexHull(p) for p in pieces]
    volume = sum(h.volume for h in hulls)
    corners = obj.vertices[obj.faces]
    exact = np.sum(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0
    assert exact * (1.0 - 1e-6) < volume < 1.05 * exact
    rng = np.random.default_rng(0)
    inside = np.concatenate([rng.dirichlet(np.ones(len(p)), 4) @ p for p in pieces])
    assert np.percentile(signed_distance(obj.solids, inside)[0], 95) < 5e-4
    surface = rng.dirichlet(np.ones(3), 60)
    points = np.einsum("ik,ikj->ij", surface, corners[rng.integers(len(corners), size=60)])
    covered = [any(np.all(h.equations[:, :3] @ x + h.equations[:, 3] < 1e-9) for h in hulls) for x in points]
    assert all(covered)


def test_a_convex_body_is_one_piece():
    cube = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
    hull = ConvexHull(cube)
    faces = np.array(
        [
            s if np.dot(np.cross(*(cube[s[1:]] - cube[s[0]])), e[:3]) > 0 else s[::-1]
            for s, e in zip(hull.simplices, hull.equations, strict=True)
        ],
        dtype=np.int32,
    )
    assert len(convex_pieces(cube, faces)) == 1


def test_a_mesh_with_a_hole_is_refused():
    mug = shipped_object("mug")
    with pytest.raises(InputError, match="watertight"):
        convex_pieces(mug.vertices, mug.faces[1:])
