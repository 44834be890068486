import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.hand.icub import icub_left_hand
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.poses import FACETS, MODES, Pose, default_pose, facet_axes

NORMALS = dict(
    zip(FACETS, np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]), strict=True)
)


def random_pose(rng):
    return Pose(tuple(rng.standard_normal(3)), tuple(Rotation.random(rng=rng).as_quat(scalar_first=True)))


def test_there_are_24_modes_all_right_handed_and_facing_the_object():
    hand, mug = icub_left_hand(), shipped_object("mug")
    assert len(MODES) == len(set(MODES)) == 24
    for mode in MODES:
        facet, thumb = mode.split("-")
        axes = facet_axes(mode)
        np.testing.assert_allclose(axes.T @ axes, np.eye(3))
        assert np.linalg.det(axes) == pytest.approx(1.0)
        np.testing.assert_array_equal(axes[:, 2], -NORMALS[facet])
        np.testing.assert_array_equal(axes[:, 0], -NORMALS[thumb])
        pose = default_pose(hand, mug, mode, 0.07)
        np.testing.assert_allclose(pose.apply(hand.grasp_center), mug.box_center + 0.07 * NORMALS[facet], atol=1e-12)


def test_offsets_move_along_the_palms_axes_and_turn_about_the_grasp_center():
    hand, mug = icub_left_hand(), shipped_object("mug")
    start = default_pose(hand, mug, "right-front", 0.05)
    moved = default_pose(hand, mug, "right-front", 0.05, (0.01, -0.02, 0.03, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(moved.apply([0, 0, 0]), start.apply([0.01, -0.02, 0.03]), atol=1e-12)
    turned = default_pose(hand, mug, "right-front", 0.05, (0.0, 0.0, 0.0, 0.3, -0.2, 0.5))
    np.testing.assert_allclose(turned.apply(hand.grasp_center), start.apply(hand.grasp_center), atol=1e-12)
    expected = start.rotation @ Rotation.from_euler("XYZ", [0.3, -0.2, 0.5]).as_matrix()  # Rx Ry Rz
    np.testing.assert_allclose(turned.rotation, expected, atol=1e-12)


def test_pose_algebra_equals_scipy():
    rng = np.random.default_rng(0)
    for _ in range(50):
        a, b, x = random_pose(rng), random_pose(rng), rng.standard_normal((4, 3))
        np.testing.assert_allclose(
            a.rotation, Rotation.from_quat(a.quaternion, scalar_first=True).as_matrix(), atol=1e-12
        )
        np.testing.assert_allclose((a @ b).apply(x), a.apply(b.apply(x)), atol=1e-12)
        np.testing.assert_allclose(a.inverse().apply(a.apply(x)), x, atol=1e-12)
        again = Pose.from_matrix(a.matrix)
        np.testing.assert_allclose(again.matrix, a.matrix, atol=1e-12)
        assert again.quaternion[0] >= 0.0
    half_turn = Pose.from_matrix(np.column_stack([np.diag([-1.0, 1.0, -1.0]), np.zeros(3)]))
    np.testing.assert_allclose(half_turn.quaternion, [0, 0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-200, 1e-120, 1e200, float("nan"), float("inf")])
def test_a_pose_is_finite_where_its_rotation_is(size):
    pose = Pose((0.1, 0.2, 0.3), (0.0, 0.0, 0.0, size))
    assert not pose.is_finite
    assert not np.isfinite(pose.rotation).any()


def test_a_quaternion_of_another_length_is_a_rotation():
    for size in (1e-90, 0.5, 3.0, 1e150):
        pose = Pose((0.0, 0.0, 0.0), (size, -size, size, size))
        assert pose.is_finite
        np.testing.assert_allclose(pose.rotation, Pose(quaternion=(0.5, -0.5, 0.5, 0.5)).rotation, atol=1e-15)


def test_bad_modes_and_matrices_are_explained():
    hand, mug = icub_left_hand(), shipped_object("mug")
    with pytest.raises(InputError, match="did you mean 'right'"):
        facet_axes("rigth-front")
    for wrong in ("right", "right-left", "right-right", "right-", "right-up"):
        with pytest.raises(InputError, match="right-front"):
            facet_axes(wrong)
    with pytest.raises(InputError, match="finite"):
        default_pose(hand, mug, "right-front", float("nan"))
    with pytest.raises(InputError, match="six finite numbers"):
        default_pose(hand, mug, "right-front", 0.05, (0.0, 0.0))
    with pytest.raises(InputError, match="no rotation"):
        Pose.from_matrix(np.column_stack([np.diag([1.0, 1.0, -1.0]), np.zeros(3)]))
    with pytest.raises(InputError, match="shape"):
        Pose.from_matrix(np.eye(3))
