import numpy as np
import pytest
import trimesh

from surehold.errors import InputError
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.shape.point_cloud import cleaned
from surehold.grasping.shape.views import camera_towards, half_view, surface_points

CAMERA = camera_towards(shipped_object("mug"), 0.4, 0.5)


@pytest.fixture(scope="module")
def mug():
    return half_view(shipped_object("mug"), CAMERA, 1500, 0.001, np.random.default_rng(0))


def table_of(n, rng):
    return np.column_stack([rng.uniform(-0.3, 0.3, (n, 2)), rng.normal(0.0, 0.0005, n)])


def test_noise_is_measured_and_normals_look_at_the_camera(mug):
    cloud = cleaned(mug, camera=CAMERA)
    assert cloud.notes[-1] in [f"noise {v} mm, measured" for v in (0.7, 0.8, 0.9, 1.0)]  # across, of 1 mm along the ray
    assert np.all(np.sum(cloud.normals * (CAMERA - cloud.points), axis=1) >= 0.0)
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(np.ones(len(cloud.normals)))


def test_a_table_is_taken_off_and_a_face_of_a_box_is_not(mug):
    rng = np.random.default_rng(1)
    with_table = cleaned(np.vstack([mug, table_of(3000, rng)]), camera=CAMERA)
    assert with_table.table is not None
    assert with_table.table.normal == pytest.approx([0.0, 0.0, 1.0], abs=0.02)
    assert abs(with_table.table.height) < 0.001
    high = mug[mug[:, 2] > 0.008]
    assert len(with_table.points) > 0.97 * len(high)
    assert np.ptp(with_table.points[:, :2], axis=0).max() < 0.13
    face = rng.uniform(-0.04, 0.04, (800, 3)) * [1.0, 1.0, 0.0]
    side = rng.uniform(-0.04, 0.04, (800, 3)) * [1.0, 0.0, 1.0] + [0.0, 0.04, -0.04]
    box = cleaned(np.vstack([face, side]), camera=np.array([0.0, 0.5, 0.5]))
    assert box.table is None


def test_outliers_and_points_that_are_not_finite_are_left_out(mug):
    rng = np.random.default_rng(2)
    spoilt = np.vstack([mug, rng.uniform(-0.3, 0.3, (40, 3)), np.full((5, 3), np.nan)])
    cloud = cleaned(spoilt, camera=CAMERA)
    assert "5 of 1,545 points are not finite" in cloud.notes[0]
    assert len(cloud.points) <= 1500
    nearest = np.linalg.norm(cloud.points[:, None] - mug[None], axis=2).min(axis=1)
    assert nearest.max() < 0.03


def test_many_points_are_thinned_and_gain_precision():
    mug = shipped_object("mug")
    dense = half_view(mug, CAMERA, 20_000, 0.002, np.random.default_rng(3))
    cloud = cleaned(dense, camera=CAMERA)
    assert len(cloud.points) <= 2500
    assert np.median(cloud.noise) < 0.001


@pytest.mark.parametrize("seen", [-1.0, 0.0])  # all of a ball, and half of it
def test_normals_that_point_inwards_are_refused(seen):
    """A ball of 60 mm was learnt as one of 86 mm from them."""
    outward = np.random.default_rng(4).normal(size=(600, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    outward = outward[outward[:, 0] > seen]
    assert np.sum(cleaned(0.03 * outward, outward).normals * outward, axis=1).min() > 0.9
    with pytest.raises(InputError, match="100 % of the normals point to the middle of the cloud; turn them"):
        cleaned(0.03 * outward, -outward)


@pytest.mark.parametrize("name", ["mug", "glass"])
def test_normals_of_thin_walls_are_taken(name):
    body = trimesh.Trimesh(shipped_object(name).vertices, shipped_object(name).faces, process=False)
    points, faces = trimesh.sample.sample_surface(body, 2000, seed=0)
    outward = body.face_normals[faces]
    np.testing.assert_allclose(cleaned(points, outward, most=5000).normals, outward, atol=1e-12)


def test_normals_of_a_file_are_turned_to_the_camera(mug):
    away = -(CAMERA - mug)
    cloud = cleaned(mug, normals=away, camera=CAMERA)
    rays = (CAMERA - cloud.points) / np.linalg.norm(CAMERA - cloud.points, axis=1)[:, None]
    assert np.sum(cloud.normals * rays, axis=1).min() > 0.99


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p[:5], "has 5 finite points"),
        (lambda p: np.full((50, 3), np.nan), "has 0 finite points"),
        (lambda p: np.tile(p[:1], (50, 1)), "has 1 different points"),
        (lambda p: 1000.0 * p, "give the unit of its numbers: --unit mm"),
        (lambda p: 0.01 * p, "spans [0-9.]+ mm; give the unit"),
        (lambda p: 10.0 * p, "too much for a hand"),
        (lambda p: np.linspace(0.0, 0.1, 200)[:, None] * [1.0, 0.5, 0.0], "lie on a line"),
        (lambda p: np.vstack([p, p[:900] + np.array([0.3, 0.0, 0.0])]), "two objects"),
    ],
)
def test_what_no_shape_can_be_learnt_from_is_said_in_one_line(mug, change, said):
    with pytest.raises(InputError, match=said) as error:
        cleaned(change(mug))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ({"camera": np.array([np.nan, 0.0, 0.0])}, "camera is .* give three finite numbers"),
        ({"camera": np.array([0.0, np.inf, 0.0])}, "camera is"),
        ({"camera": np.zeros(2)}, "camera is"),
        ({"noise": float("nan")}, "noise of the points is nan"),
        ({"noise": -1.0}, "noise of the points is -1.0; give a standard deviation of 0 m or more"),
        ({"most": 0}, "most is 0; keep 20 points or more"),  # it never ended
    ],
)
def test_numbers_out_of_range_are_refused(mug, option, said):
    with pytest.raises(InputError, match=said):
        cleaned(mug, **option)


def fingers(n, rng):
    """Two fingers on both sides of the view, 3 to 10 cm before the camera."""
    view = -CAMERA / np.linalg.norm(CAMERA)
    side = np.cross(view, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    turn, along = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(0.03, 0.10, n)
    round_ = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(side, view)
    return CAMERA + along[:, None] * view + 0.008 * round_ + np.where(np.arange(n) % 2, 0.012, -0.012)[:, None] * side


@pytest.mark.parametrize("n", [60, 1000])
def test_the_fingers_before_a_camera_on_the_hand_are_left_out(mug, n):
    own = fingers(n, np.random.default_rng(5))
    cloud = cleaned(np.vstack([mug, own]), camera=CAMERA)
    assert (
        any("of the camera, as of a hand, were left out" in note for note in cloud.notes) or n == 60
    )  # or as outliers
    assert np.abs(distance_field_of(shipped_object("mug")).distance(cloud.points)).max() < 0.006


def test_a_hand_that_is_most_of_the_cloud_is_refused(mug):
    with pytest.raises(InputError, match="take out those of the hand that carries the camera") as error:
        cleaned(np.vstack([mug[::4], fingers(2000, np.random.default_rng(5))]), camera=CAMERA)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="without the hand's own points"):
        cleaned(np.vstack([mug, fingers(2000, np.random.default_rng(5))]))


def test_a_camera_among_the_points_is_refused(mug):
    with pytest.raises(InputError, match="lies among the points"):
        cleaned(mug, camera=mug.mean(axis=0))
    with pytest.raises(InputError, match="lies among the points"):
        cleaned(mug, camera=mug[0])  # it ended in a traceback
    with pytest.raises(InputError, match="lies among the points"):
        cleaned(mug, camera=mug[0] + 0.005 * CAMERA / np.linalg.norm(CAMERA))


def test_pixels_without_a_distance_lie_in_the_camera_and_say_nothing(mug):
    seen = mug - CAMERA
    alone = cleaned(seen, camera=np.zeros(3))
    cloud = cleaned(np.vstack([np.zeros((70_000, 3)), seen]), camera=np.zeros(3))
    np.testing.assert_array_equal(cloud.points, alone.points)
    assert "70,000 points lie in the camera and were left out" in cloud.notes


def test_a_camera_in_another_unit_is_told(mug):
    assert any("m away: give it in the unit" in note for note in cleaned(mug, camera=1000.0 * CAMERA).notes)
    assert not any("m away" in note for note in cleaned(mug, camera=CAMERA).notes)


def test_ten_million_points_are_thinned_before_anything_else():
    rng = np.random.default_rng(4)
    places = surface_points(shipped_object("mug"), 400_000, rng)[0].astype(np.float32)
    many = np.repeat(places, 25, axis=0)
    many += rng.normal(0.0, 0.0005, many.shape).astype(np.float32)
    many[:20_000] = rng.uniform(-0.3, 0.3, (20_000, 3))  # single points in the air
    cloud = cleaned(many)
    assert cloud.notes[0].startswith("of 10,000,000 points ")
    assert len(cloud.points) <= 2500
    off = np.abs(distance_field_of(shipped_object("mug")).distance(cloud.points))
    # Means in cubes of 4 mm lie up to 1.4 mm inside edges even without noise.
    assert np.quantile(off, 0.95) < 0.0020
    assert off.mean() < 0.0008


def test_of_many_points_those_of_a_small_part_are_not_lost():
    rng = np.random.default_rng(6)
    part = surface_points(shipped_object("mug"), 3_000, rng)[0]
    dense = np.column_stack([rng.uniform(-0.3, 0.3, (400_000, 2)), rng.normal(0.0, 0.0003, 400_000)])
    cloud = cleaned(np.vstack([dense, part]), camera=CAMERA)
    assert cloud.table is not None
    assert len(cloud.points) > 1500
    assert np.ptp(cloud.points, axis=0) == pytest.approx(np.ptp(part, axis=0), abs=0.01)
