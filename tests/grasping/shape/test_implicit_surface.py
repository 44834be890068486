import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize

from surehold.grasping.shape.implicit_surface import Observations, learnt_scales, spaced, surface_of
from surehold.grasping.shape.kernel import covariance, cross_covariance, fast_function_values, function_values
from surehold.grasping.shape.prior import PriorShape

PRIOR = PriorShape("ellipsoid", np.zeros(3), np.eye(3), np.array([0.045, 0.035, 0.05]))


def sphere(n, radius=0.04, seed=0, noise=2e-4, slopes=0):
    u = np.random.default_rng(seed).standard_normal((n, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    few = u[:slopes]
    return Observations(
        radius * u, np.zeros(n), np.full(n, noise), radius * few, few, np.full(slopes, 0.05), np.empty((0, 4))
    )


def test_mean_and_deviation_are_those_of_scikit_learn():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    told = sphere(40)
    surface = surface_of(PRIOR, told, 0.01, 0.03)
    kernel = ConstantKernel(0.01**2, "fixed") * Matern(0.03, "fixed", nu=2.5)
    other = GaussianProcessRegressor(kernel, alpha=2e-4**2 + (1e-6 * 0.01) ** 2, optimizer=None)
    other.fit(told.points, -PRIOR.value(told.points))
    x = np.random.default_rng(1).uniform(-0.06, 0.06, (30, 3))
    mean, std = other.predict(x, return_std=True)
    assert surface.value(x) == pytest.approx(PRIOR.value(x) + mean, abs=1e-8)
    assert surface.deviation(x) == pytest.approx(std, abs=1e-7)


@pytest.mark.parametrize("stray", [2e-4, 1e-3])
def test_learnt_scales_are_those_of_highest_density_by_scikit_learn(stray):
    """Likelihood by scikit-learn, log-normal priors by SciPy; also where the points scatter more than is told."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    told = sphere(60)
    points = told.points * (1.0 + stray / 0.04 * np.random.default_rng(1).standard_normal((60, 1)))
    size = np.prod(PRIOR.half) ** (1.0 / 3.0)

    def density(logs):
        std, length, more = np.exp(logs)
        kernel = ConstantKernel(std**2, "fixed") * Matern(length, "fixed", nu=2.5)
        process = GaussianProcessRegressor(kernel, alpha=(more * 2e-4) ** 2, optimizer=None)
        likelihood = process.fit(points, -PRIOR.value(points)).log_marginal_likelihood_value_
        return likelihood + stats.norm.logpdf(logs, np.log([0.2 * size, size, 1.0]), np.log([1.6, 1.6, 2.0])).sum()

    found = np.log(learnt_scales(PRIOR, Observations(points, told.values, told.noise)))
    assert found[2] == pytest.approx(0.0, abs=2e-3), "the noise stays what is told"
    start = np.log([0.2 * size, size])
    steps = {"initial_simplex": np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.4]]) + start}
    best = minimize(lambda logs: -density([*logs, found[2]]), start, method="Nelder-Mead", options=steps)
    assert density(found) > -best.fun - 0.1
    assert learnt_scales(PRIOR, Observations()) == pytest.approx((0.2 * size, size, 1.0))


def test_covariances_of_slopes_are_differences_of_those_of_values():
    rng = np.random.default_rng(0)
    x, s = rng.uniform(-0.05, 0.05, (6, 3)), rng.uniform(-0.05, 0.05, (4, 3))
    h = 1e-5
    values = cross_covariance(x, np.empty((0, 3)), s, 0.01, 0.03).reshape(6, 4, 3)
    ends = [[cross_covariance(x, s + t * h * e, np.empty((0, 3)), 0.01, 0.03) for t in (1, -1)] for e in np.eye(3)]
    expected = np.stack([(a - b) / (2 * h) for a, b in ends], axis=2)
    assert np.abs(values - expected).max() < 1e-6 * np.abs(expected).max()
    gram = covariance(np.empty((0, 3)), s, 0.01, 0.03).reshape(4, 3, 4, 3)
    rows = [[cross_covariance(s + t * h * e, np.empty((0, 3)), s, 0.01, 0.03) for t in (1, -1)] for e in np.eye(3)]
    expected = np.stack([(a - b).reshape(4, 4, 3) / (2 * h) for a, b in rows], axis=1)
    assert np.abs(gram - expected).max() < 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("slopes", [0, 15])
def test_gradient_and_second_derivatives_are_differences(slopes):
    surface = surface_of(PRIOR, sphere(60, slopes=slopes), 0.01, 0.03)
    x = np.random.default_rng(2).uniform(0.01, 0.05, (20, 3))
    h = 1e-5
    gradient = np.stack([(surface.value(x + h * e) - surface.value(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    ends = [(surface.gradient(x + h * e), surface.gradient(x - h * e)) for e in np.eye(3)]
    hessian = np.stack([(a - b) / (2 * h) for a, b in ends], axis=1)
    assert np.abs(gradient - surface.gradient(x)).max() < 1e-5
    assert np.abs(hessian - surface.hessian(x)).max() < 1e-4 * np.abs(hessian).max()


def test_slopes_are_learnt():
    told = sphere(20, slopes=20)
    with_slopes = surface_of(PRIOR, told, 0.01, 0.03)
    gradient = with_slopes.gradient(told.slope_points)
    assert np.abs(gradient - told.slopes).max() < 0.1
    without = surface_of(PRIOR, sphere(20), 0.01, 0.03)
    assert np.all(with_slopes.deviation(1.1 * told.points) < without.deviation(1.1 * told.points))


def test_a_sphere_is_recovered_from_a_wrong_prior():
    told = sphere(400)
    std, length, _ = learnt_scales(PRIOR, told)
    surface = surface_of(PRIOR, told, std, length)
    u = sphere(300, seed=9).points / 0.04
    # The zero along each ray: f is close to linear there.
    r = 0.04 - surface.value(0.04 * u) / np.einsum("ni,ni->n", surface.gradient(0.04 * u), u)
    assert np.abs(r - 0.04).max() < 3e-4
    assert np.abs(r - 0.04).mean() < 5e-5


def test_a_box_is_recovered_from_a_wrong_prior():
    half = np.array([0.03, 0.04, 0.05])
    rng = np.random.default_rng(0)

    def points(n, rng):
        face = rng.integers(3, size=n)
        x = rng.uniform(-1.0, 1.0, (n, 3))
        x[np.arange(n), face] = np.sign(x[np.arange(n), face])
        return x * half

    wrong = PriorShape("box", np.array([0.004, -0.003, 0.0]), np.eye(3), half + 0.006)
    told = Observations(points(800, rng), np.zeros(800), np.full(800, 2e-4))
    std, length, _ = learnt_scales(wrong, told)
    surface = surface_of(wrong, told, std, length)
    others = points(500, rng)
    off = np.abs(surface.value(others))
    inner = np.sum(np.abs(others) > half - 0.006, axis=1) == 1  # 6 mm off the edges
    assert off[inner].mean() < 2e-4
    assert np.quantile(off, 0.95) < 1.5e-3


def test_single_precision_is_off_by_micrometers():
    rng = np.random.default_rng(3)
    surface = surface_of(PRIOR, sphere(300, slopes=60), 0.01, 0.03)
    x = rng.uniform(-0.06, 0.06, (300, 3))
    known = surface.observations
    rest = (known.points, known.slope_points, surface.alpha, surface.beta, surface.std, surface.length)
    assert fast_function_values(x, *rest) == pytest.approx(function_values(x, *rest), abs=1e-5)
    assert surface.fast_value(x) == pytest.approx(surface.value(x), abs=1e-5)
    nothing = surface_of(PRIOR, Observations(), 0.01, 0.03)
    assert np.array_equal(nothing.fast_value(x), PRIOR.value(x))


def test_a_bound_acts_only_where_it_is_broken():
    told = sphere(30)
    plain = surface_of(PRIOR, told, 0.01, 0.03)
    far = np.array([[0.08, 0.0, 0.0, 0.01]])
    same = surface_of(PRIOR, told + Observations(free=far), 0.01, 0.03)
    assert len(same.observations.points) == 30
    inside = np.array([[0.0, 0.0, 0.0, 0.002]])  # in the middle of the sphere: plain says -40 mm
    assert plain.value(inside[:, :3])[0] < -0.02
    bound = surface_of(PRIOR, told + Observations(free=inside), 0.01, 0.03)
    assert bound.value(inside[:, :3])[0] == pytest.approx(0.002, abs=0.001)


def test_a_surface_with_active_bounds_is_that_of_all_its_observations_at_once():
    told = sphere(30, slopes=12)
    inside = np.array([[0.0, 0.0, 0.0, 0.002], [0.02, 0.01, 0.0, 0.001]])
    bound = surface_of(PRIOR, told + Observations(free=inside), 0.01, 0.03)
    assert len(bound.observations.points) > 30
    once = surface_of(PRIOR, bound.observations, 0.01, 0.03)
    x = np.random.default_rng(5).uniform(-0.06, 0.06, (40, 3))
    assert bound.value(x) == pytest.approx(once.value(x), abs=1e-9)
    assert bound.deviation(x) == pytest.approx(once.deviation(x), abs=1e-8)
    columns = np.random.default_rng(6).standard_normal((len(once.factor), 2))
    for mine, theirs in zip(bound.solved(columns), once.solved(columns), strict=True):
        assert mine == pytest.approx(theirs, rel=1e-6, abs=1e-6 * np.abs(theirs).max())


def test_contradictory_contacts_are_averaged_not_refused():
    x = np.array([[0.05, 0.0, 0.0], [0.05, 0.0, 0.0]])
    told = Observations(x, np.array([0.0, 0.004]), np.full(2, 5e-4))
    surface = surface_of(PRIOR, told, 0.01, 0.03)
    assert surface.value(x[:1])[0] == pytest.approx(0.002, abs=1e-4)


def test_spaced_points_share_no_cube():
    x = np.random.default_rng(0).uniform(0.0, 0.1, (300, 3))
    kept = x[spaced(x, 0.02)]
    assert len(np.unique(np.floor(kept / 0.02), axis=0)) == len(kept) <= 125
    assert len(np.unique(np.floor(x / 0.02), axis=0)) == len(kept)
