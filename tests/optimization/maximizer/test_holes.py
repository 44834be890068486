import numpy as np
import pytest
from scipy.spatial.distance import cdist

from surehold.optimization.maximizer.holes import largest_holes


@pytest.mark.parametrize("d", [1, 2, 5])
def test_centers_of_the_largest_balls_come_first(d):
    points = np.random.default_rng(0).random((12, d))
    centers = largest_holes(points, np.random.default_rng(1))
    border = np.minimum(centers, 1.0 - centers).min(axis=1)
    radius = np.minimum(cdist(centers, points).min(axis=1), 2.0 * border)
    assert np.all(np.diff(radius) <= 1e-12)
    assert radius[0] > 2.0 * np.median(radius)


def test_a_square_without_its_left_half():
    points = np.stack(np.meshgrid(np.linspace(0.5, 1.0, 6), np.linspace(0.0, 1.0, 11)), axis=-1).reshape(-1, 2)
    center = largest_holes(points, np.random.default_rng(0))[0]
    # Of a ball that may reach half its radius beyond the left side: x = r / 2 and 0.5 - x = r.
    np.testing.assert_allclose(center[0], 1.0 / 6.0, atol=0.03)
