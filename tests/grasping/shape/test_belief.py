from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.shape.belief import REACH, ShapeBelief, _Waves, grid_of
from surehold.grasping.shape.implicit_surface import Observations, surface_of
from surehold.grasping.shape.level_set import Grid
from surehold.grasping.shape.prior import PriorShape

BOX = PriorShape("box", np.zeros(3), np.eye(3), np.array([0.03, 0.03, 0.04]))


@pytest.fixture(scope="module")
def belief():
    u = np.random.default_rng(0).standard_normal((30, 3))
    u = 0.035 * u / np.linalg.norm(u, axis=1)[:, None]
    u = u[u[:, 0] > 0.0]
    normals = u[:5] / 0.035
    told = Observations(u, np.zeros(len(u)), np.full(len(u), 5e-4), u[:5], normals, np.full(5, 0.1))
    surface = surface_of(BOX, told, 0.006, 0.03)
    return ShapeBelief(surface, grid_of(surface, 0.006))


def test_draws_have_mean_and_deviation_of_the_posterior(belief):
    grid = Grid(np.full(3, -0.03), 0.02, (3, 3, 3))
    values = ShapeBelief(belief.surface, grid).values(3000, np.random.default_rng(1)).reshape(3001, -1)
    mean, std = belief.surface.value(grid.nodes), belief.surface.deviation(grid.nodes)
    assert values[0] == pytest.approx(mean, abs=2e-6)  # single precision
    draws = values[1:]
    # 400 waves share their frequencies: the kernel itself is off by about 1 / sqrt(400).
    assert np.abs(draws.mean(axis=0) - mean).max() < 0.1 * std.max()
    assert draws.std(axis=0) == pytest.approx(std, abs=0.12 * belief.surface.std)


def test_draws_vary_by_the_noise_of_what_was_measured():
    """A value and a slope, each measured as well as it was known before: their variance is half of that."""
    std, length = 0.006, 0.03
    steepness = np.sqrt(5.0 / 3.0) * std / length  # standard deviation of a slope before
    places = np.array([[-0.5, 0.0, 0.0], [0.001, 0.0, 0.0]])
    told = Observations(places[:1], np.zeros(1), np.full(1, std), places[1:], np.eye(3)[:1], np.full(1, steepness))
    surface = surface_of(BOX, told, std, length)
    rng = np.random.default_rng(2)
    at = ShapeBelief(surface, Grid(places[0], 0.002, (1, 1, 1))).values(4000, rng)[1:, 0, 0, 0]
    beside = ShapeBelief(surface, Grid(np.zeros(3), 0.001, (3, 1, 1))).values(4000, rng)[1:, :, 0, 0]
    slope = (beside[:, 2] - beside[:, 0]) / 0.002
    assert at.std() == pytest.approx(np.sqrt(0.5) * std, rel=0.05)
    assert slope.std() == pytest.approx(np.sqrt(0.5) * steepness, rel=0.05)


def test_waves_are_those_of_the_spectral_density(belief):
    """Of Matérn-5/2 a t-distribution of 5 degrees of freedom: a third of |o|^2 l^2 has an F-distribution."""
    o = np.vstack([_Waves(belief.surface, 1, np.random.default_rng(seed))._o for seed in range(20)])
    squared = np.sum(o * o, axis=1) * belief.surface.length**2
    assert stats.kstest(squared / 3.0, stats.f(3, 5).cdf).pvalue > 1e-3
    assert stats.kstest(o[:, 1] * belief.surface.length, stats.t(5).cdf).pvalue > 1e-3


def test_the_grid_reaches_beyond_what_was_measured_outside_of_the_prior_shape():
    for side in (-1.0, 1.0):
        told = Observations(np.array([[side * 0.09, side * 0.02, side * 0.1]]), np.zeros(1), np.full(1, 5e-4))
        grid = grid_of(surface_of(BOX, told, 0.006, 0.03), 0.004)
        finger = told.points + REACH * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
        assert np.all(grid.gap(finger) == 0.0)


def test_draws_pass_through_what_was_measured(belief):
    objects = belief.objects(3, np.random.default_rng(0))
    for obj in objects:
        off = distance_field_of(obj).distance(belief.surface.observations.points)
        assert np.abs(off).max() < 2.5e-3
    back = np.array([[-0.03, 0.0, 0.0]])
    away = [distance_field_of(obj).distance(back)[0] for obj in objects[1:]]
    assert np.ptp(away) > 1e-3  # not known there


def test_draws_follow_from_the_generator_alone(belief):
    first, second = (belief.values(2, np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(first, second)
    with pytest.raises(InputError, match="random generator"):
        belief.values(1)


def test_draws_are_of_the_process_of_shapes_where_there_is_one(belief):
    other = surface_of(BOX, belief.surface.observations, 0.002, 0.06)
    both = ShapeBelief(belief.surface, belief.grid, shapes=other)
    mean, *draws = both.values(3, np.random.default_rng(0))
    assert np.array_equal(mean, belief.values()[0])
    assert np.array_equal(draws, ShapeBelief(other, belief.grid).values(3, np.random.default_rng(0))[1:])


def test_both_processes_know_what_is_told(belief):
    other = surface_of(BOX, belief.surface.observations, 0.002, 0.06)
    place = np.array([[-0.02, 0.0, 0.0]])
    told = belief.surface.observations + Observations(place, np.zeros(1), np.full(1, 1e-4))
    free = np.array([[-0.05, 0.0, 0.0, 0.004]])
    after = ShapeBelief(belief.surface, belief.grid, shapes=other).knowing(told, free)
    for surface, before in ((after.surface, belief.surface), (after.shapes, other)):
        assert (surface.std, surface.length) == (before.std, before.length)
        assert abs(surface.value(place)[0]) < 3e-4 < 3e-3 < abs(before.value(place)[0])
    assert np.array_equal(after.free, free)


def test_values_between_coarse_nodes_are_those_of_all_nodes_near_the_surface(belief):
    values = belief.values()[0]
    exact = belief.surface.value(belief.grid.nodes).reshape(values.shape)
    near = np.abs(exact) < 1.5 * belief.grid.cell
    assert values[near] == pytest.approx(exact[near], abs=2e-6)
    assert np.array_equal(values < 0.0, exact < 0.0)


@pytest.mark.parametrize("cell", [0.002, 0.0023, 0.0037])
def test_mass_and_center_of_a_box(cell):
    surface = surface_of(BOX, Observations(), 0.006, 0.03)
    obj = ShapeBelief(surface, grid_of(surface, cell)).mean_object()
    volume = 8.0 * np.prod(BOX.half)  # round edges take a little
    assert 0.93 * volume < obj.mass / 1000.0 < volume
    assert np.abs(obj.center_of_mass).max() < 3e-5
    assert obj.box_half_extents == pytest.approx(BOX.half, abs=2e-4)


def test_a_box_that_is_turned_keeps_its_axes():
    turned = replace(BOX, axes=Rotation.from_euler("xyz", [0.4, -0.3, 0.6]).as_matrix())
    surface = surface_of(turned, Observations(), 0.006, 0.03)
    obj = ShapeBelief(surface, grid_of(surface, 0.002)).mean_object()
    assert np.array_equal(obj.axes, turned.axes)
    assert obj.box_half_extents == pytest.approx(BOX.half, abs=2e-4)


def test_no_draw_fills_what_is_free(belief):
    place = np.array([[-0.045, 0.0, 0.0]])  # behind, where nothing was measured
    within = np.linalg.norm(belief.grid.nodes - place, axis=1) < 0.012
    surface = surface_of(BOX, belief.surface.observations, 0.02, 0.02)
    wild = ShapeBelief(surface, belief.grid)
    mean, *draws = wild.values(6, np.random.default_rng(0)).reshape(7, -1)
    assert np.sum(np.array(draws)[:, within] < 0.0) > 0
    free = replace(wild, free=np.array([[*place[0], 0.012], [0.3, 0.0, 0.0, 0.001]]))
    same, *lifted = free.values(6, np.random.default_rng(0)).reshape(7, -1)
    assert np.all(np.array(lifted)[:, within] >= 0.0)
    assert np.array_equal(mean, same)
    floor = 0.012 - np.linalg.norm(belief.grid.nodes - place, axis=1)
    changed = np.array(lifted) != np.array(draws)
    assert np.array(lifted)[changed] == pytest.approx(np.broadcast_to(floor, changed.shape)[changed], abs=1e-12)


def test_draws_that_enclose_nothing_are_no_shapes(belief):
    """Space that draws know to be free, but the mean does not, takes all of them: the draws are lifted to it."""
    lifted = replace(belief, free=np.array([[0.0, 0.0, 0.0, 0.5]]))
    assert np.all(lifted.values(3, np.random.default_rng(0))[1:] > 0.0)
    (mean,) = lifted.objects(3, np.random.default_rng(0))
    assert mean.mass == pytest.approx(belief.mean_object().mass)
