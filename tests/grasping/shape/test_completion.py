import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.shape.completion import belief_of_cloud, mirrored
from surehold.grasping.shape.point_cloud import cleaned
from surehold.grasping.shape.views import camera_towards, half_view, hidden_mask, surface_points


def seen(name, azimuth=0.7, n=600):
    obj = shipped_object(name)
    camera = camera_towards(obj, azimuth, 0.3)
    return obj, camera, cleaned(half_view(obj, camera, n, 0.001, np.random.default_rng(0)), camera=camera)


def test_half_views_are_on_the_surface_and_seen():
    obj = shipped_object("mug")
    camera = camera_towards(obj, 2.0, 0.4)
    points = half_view(obj, camera, 400, 0.0, np.random.default_rng(0))
    assert np.abs(distance_field_of(obj).distance(points)).max() < 1e-4
    assert not hidden_mask(distance_field_of(obj), points, camera).any()
    with pytest.raises(InputError, match="inside"):
        half_view(obj, np.array([0.038, 0.0, 0.05]), 10, 0.0, np.random.default_rng(0))


def test_a_bottle_is_mirrored_at_a_plane_through_its_axis():
    _, _, cloud = seen("bottle")
    other = mirrored(cloud, np.eye(3))
    assert abs(other.depth) < 0.006  # the axis is at the origin
    radius = np.linalg.norm(other.points[other.points[:, 2] < 0.09][:, :2], axis=1)
    assert np.median(np.abs(radius - 0.02625)) < 0.004


def test_a_bottle_is_known_where_it_was_seen_and_honest_where_not():
    obj, camera, cloud = seen("bottle")
    belief = belief_of_cloud(cloud, mass=0.3)
    mean = belief.mean_object()
    assert mean.mass == 0.3
    places = surface_points(obj, 600, np.random.default_rng(1))[0]
    hidden = hidden_mask(distance_field_of(obj), places, camera)
    off = np.abs(distance_field_of(mean).distance(places))
    assert off[~hidden].mean() < 0.001
    assert off[hidden].mean() < 0.008
    deviation = belief.surface.deviation(places)
    assert deviation[hidden].mean() > 4.0 * deviation[~hidden].mean()
    inside = np.abs(belief.surface.value(places)) < 1.96 * deviation
    assert inside[hidden].mean() > 0.8


def test_normals_of_drawn_shapes_are_those_of_an_object():
    obj, camera, cloud = seen("bottle")
    field = distance_field_of(obj)
    for body in belief_of_cloud(cloud, mass=0.3).objects(4, np.random.default_rng(0))[1:]:
        places = body.vertices[body.faces].mean(axis=1)
        own, true = distance_field_of(body).gradient(places), field.gradient(places)
        off = np.degrees(np.arccos(np.clip(np.sum(own * true, axis=1), -1.0, 1.0)))
        hidden = hidden_mask(field, places - field.distance(places)[:, None] * true, camera)
        assert np.median(off[~hidden]) < 12.0
        assert np.median(off[hidden]) < 27.0  # of friction 0.5, beyond which no finger holds


def test_a_shape_ends_where_nothing_was_seen_below_it():
    obj, _, cloud = seen("glass")
    assert cloud.table is None
    assert belief_of_cloud(cloud).mean_object().box_half_extents[2] < 1.18 * obj.box_half_extents[2]


def test_an_object_stands_on_its_table_however_that_is_turned():
    """The lowest 4 mm count to the table, and the camera stands above."""
    obj, rng = shipped_object("bottle"), np.random.default_rng(0)
    camera = camera_towards(obj, 0.7, 0.6)
    table = np.column_stack([rng.uniform(-0.15, 0.15, (1200, 2)), rng.normal(0.0, 0.0005, 1200)])
    points = np.vstack([half_view(obj, camera, 400, 0.001, rng), table])
    turn, shift = Rotation.from_euler("xyz", [0.5, -0.4, 0.8]).as_matrix(), np.array([0.1, 0.05, 0.3])
    cloud = cleaned(points @ turn.T + shift, camera=turn @ camera + shift)
    assert cloud.table is not None
    assert cloud.table.normal == pytest.approx(turn[:, 2], abs=2e-3)
    belief = belief_of_cloud(cloud)
    box, mean = belief.surface.first, belief.mean_object()
    assert mean.axes.T @ cloud.table.normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert box.center @ cloud.table.normal - box.half[2] == pytest.approx(cloud.table.height, abs=1e-9)
    height = mean.vertices @ cloud.table.normal - cloud.table.height
    assert -0.004 < height.min() < 0.001
    assert height.max() == pytest.approx(0.160, abs=0.003)
    assert mean.mass == pytest.approx(obj.mass, rel=0.15)
    assert (mean.center_of_mass - shift) @ turn == pytest.approx(obj.center_of_mass, abs=0.004)


@pytest.mark.parametrize("prior", ["box", "ellipsoid"])
def test_other_priors_pass_through_the_cloud(prior):
    _, _, cloud = seen("glass")
    mean = belief_of_cloud(cloud, prior).mean_object()
    assert np.abs(distance_field_of(mean).distance(cloud.points)).mean() < 0.0012


def test_what_the_camera_saw_free_is_outside():
    obj, camera, cloud = seen("drill")
    mean = belief_of_cloud(cloud).mean_object()
    before = cloud.points + 0.012 * (camera - cloud.points) / np.linalg.norm(camera - cloud.points, axis=1)[:, None]
    free = distance_field_of(obj).distance(before) > 0.006
    assert np.mean(distance_field_of(mean).distance(before[free]) > 0.0) > 0.97


def test_an_unknown_prior():
    _, _, cloud = seen("bottle")
    with pytest.raises(InputError, match="did you mean 'mirror'"):
        belief_of_cloud(cloud, "miror")


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ({"cell": -0.002}, "grid cell is -0.002; give a positive length"),
        ({"cell": float("nan")}, "grid cell is nan"),
        ({"spread": (0.0, 0.4)}, r"spread is \(0.0, 0.4\); give two positive numbers"),
        ({"drawn": (0.4, float("inf"))}, "drawn is"),
    ],
)
def test_lengths_that_are_none_are_refused(option, said):
    _, _, cloud = seen("bottle", n=60)
    with pytest.raises(InputError, match=said):
        belief_of_cloud(cloud, **option)
