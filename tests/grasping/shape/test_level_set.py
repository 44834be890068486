import numpy as np
import pytest

from surehold.errors import SureholdError
from surehold.grasping.object.solids import RoundedBox, signed_distance
from surehold.grasping.shape.level_set import Grid, distances_of, grid_around, level_set_mesh, one_piece

GRID = grid_around(np.full(3, -0.04), np.full(3, 0.04), 0.002, 0.02)
CENTER = np.array([0.0003, 0.0007, -0.0002])  # no node lies exactly on a surface


def values_of(function):
    return function(GRID.nodes).reshape(GRID.shape)


def test_a_grid_has_no_more_nodes_than_it_may():
    half = np.array([0.09, 0.035, 0.08])
    coarse = grid_around(-half, half, 0.001, 0.02, most=5000)
    assert 4000 < np.prod(coarse.shape) <= 5000
    assert np.all(coarse.nodes.max(axis=0) >= half + 0.02 - 1e-12)


def test_gaps_to_a_grid():
    last = GRID.nodes.max(axis=0)
    points = np.array([[0.0, 0.0, 0.0], np.add(last, [0.0, 0.03, 0.04]), GRID.first - [0.01, 0.0, 0.0]])
    assert GRID.gap(points) == pytest.approx([0.0, 0.05, 0.01])


def test_distance_of_a_sphere_from_a_function_that_is_none():
    field = distances_of(values_of(lambda x: np.sum(x * x, axis=1) / 0.04 - 0.04), GRID)  # no distance, but its zeros
    x = np.random.default_rng(0).uniform(-0.055, 0.055, (4000, 3))
    r = np.linalg.norm(x, axis=1)
    x, r = x[r > 0.01], r[r > 0.01]
    off = np.abs(field.distance(x) - (r - 0.04))
    assert off[np.abs(r - 0.04) < 0.010].max() < 2e-4
    assert off.mean() < 3e-5
    assert off.max() < 1e-3  # towards the middle, where many places of the surface are about equally near
    slope = field.gradient(x)
    assert np.abs(slope - x / r[:, None]).max() < 0.06


def test_distance_of_a_box_is_kept():
    box = (RoundedBox((0, 0, 0), (0.03, 0.035, 0.04), 0.004),)
    field = distances_of(values_of(lambda x: signed_distance(box, x)[0]), GRID)
    x = np.random.default_rng(1).uniform(-0.055, 0.055, (3000, 3))
    exact = signed_distance(box, x)[0]
    near = exact > -0.01
    assert np.abs(field.distance(x) - exact)[near].max() < 5e-4


def test_gaps_are_lipschitz():
    field = distances_of(values_of(lambda x: 5.0 * (np.linalg.norm(x, axis=1) - 0.04)), GRID)
    a = np.random.default_rng(2).uniform(-0.05, 0.05, (2000, 3))
    b = a + np.random.default_rng(3).uniform(-0.003, 0.003, (2000, 3))
    change = np.abs(field.distance(a) - field.distance(b)) - np.linalg.norm(a - b, axis=1)
    assert change.max() < 3e-4  # the closing steps by these gaps


def test_mesh_is_closed_and_looks_outward():
    import trimesh

    vertices, faces = level_set_mesh(values_of(lambda x: np.linalg.norm(x - CENTER, axis=1) - 0.04), GRID)
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.04**3, rel=0.005)
    assert np.linalg.norm(vertices - CENTER, axis=1) == pytest.approx(np.full(len(vertices), 0.04), abs=5e-5)


def test_only_the_largest_part_stays():
    a, b = np.array([-0.02, 0, 0]), np.array([0.03, 0, 0])

    def two(x):
        return np.minimum(np.linalg.norm(x - a, axis=1) - 0.02, np.linalg.norm(x - b, axis=1) - 0.01)

    values = one_piece(values_of(two))
    places = GRID.nodes[(values < 0.0).ravel()]
    assert len(places)
    assert np.all(np.linalg.norm(places - a, axis=1) < 0.02)


def test_a_smaller_part_stays_where_it_was_measured():
    a, b = np.array([-0.02, 0, 0]), np.array([0.03, 0, 0])

    def two(x):
        return np.minimum(np.linalg.norm(x - a, axis=1) - 0.02, np.linalg.norm(x - b, axis=1) - 0.01)

    values = values_of(two)
    directions = np.random.default_rng(0).standard_normal((40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    seen = GRID.nearest(np.vstack([np.repeat(a + 0.02 * directions, 5, axis=0), b + 0.01 * directions]))
    assert np.array_equal(one_piece(values, seen), values)
    assert np.sum(one_piece(values, seen[:200]) < 0.0) < np.sum(values < 0.0)
    assert GRID.nodes.reshape(*GRID.shape, 3)[tuple(GRID.nearest(b[None])[0])] == pytest.approx(b, abs=0.001)


def test_nothing_inside_is_an_error():
    with pytest.raises(SureholdError, match="encloses nothing"):
        one_piece(np.ones((3, 3, 3)))


def test_grid_has_odd_numbers_of_nodes_and_covers_the_box():
    grid = grid_around(np.zeros(3), np.array([0.1, 0.05, 0.031]), 0.003, 0.01)
    assert all(n % 2 == 1 for n in grid.shape)
    assert np.all(grid.nodes.max(axis=0) >= np.array([0.11, 0.06, 0.041]) - 1e-12)
    large = grid_around(np.zeros(3), np.ones(3), 0.001, 0.0)
    assert np.prod(large.shape) < 1.7e6
    assert isinstance(large, Grid)
