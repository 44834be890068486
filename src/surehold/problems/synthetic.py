"""Synthetic functions with known optima and known expectations under Gaussian input noise.

Notation (k bumps, d inputs, n points)

    x    (n, d)     points, in the units of the box
    c_k  (d,)       center of bump k
    C_k  (d, d)     covariance (shape) of bump k
    w_k             height of bump k
    N    (d, d)     covariance of the input noise, in the units of the box

A sum of Gaussian bumps f(x) = sum_k w_k exp(-(x - c_k)' C_k^-1 (x - c_k) / 2) stays one when its input is shaken by
N(0, N): C_k becomes C_k + N and w_k shrinks by (|C_k| / |C_k + N|)^(1/2). Its square is a sum of bumps too, so mean and
standard deviation of the outcome are closed-form as long as the noise does not reach the border of the box. Where it
does, the rule of the re-queries holds: a coordinate that would leave the box keeps its noise-free value. That case is
integrated numerically (module `border`).
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, needed_input_noise
from surehold.problems.border import Moments, moments_at_border
from surehold.problems.problem import Optimum, checked_points

__all__ = ["GF", "GM", "RKHS", "SYNTHETIC", "GaussianBumps", "highest", "robust_optimum", "synthetic_function"]


class GaussianBumps:
    """A sum of Gaussian bumps on a box: f(x) = sum_k w_k exp(-(x - c_k)' C_k^-1 (x - c_k) / 2).

    Parameters
    ----------
    name
        Short name.
    box
        Named bounds of the d inputs.
    heights
        (k,) w_k.
    centers
        (k, d) c_k, in the units of the box.
    covariances
        (k, d, d) C_k, each symmetric positive definite.
    optimum
        The point (d,) of the highest value in the box, where it is known.
    border
        What an input that leaves the box is worth: "keep" gives the coordinate its noise-free value, "extend" goes on
        with the formula.

    Raises
    ------
    InputError
        If shapes do not fit, a covariance is not positive definite or the border rule is unknown.
    """

    def __init__(
        self,
        name: str,
        box: Box,
        heights: ArrayLike,
        centers: ArrayLike,
        covariances: ArrayLike,
        optimum: ArrayLike | None = None,
        border: str = "keep",
    ):
        if border not in ("keep", "extend"):
            raise unknown_name("border rule", border, ("keep", "extend"))
        self.name: Final[str] = name
        self.box: Final[Box] = box
        self.border: Final[str] = border
        self.heights: Final = np.array(heights, dtype=np.float64)
        self.centers: Final = np.array(centers, dtype=np.float64)
        self.covariances: Final = np.array(covariances, dtype=np.float64)
        k, d = self.heights.size, box.dimension
        shapes = (self.heights.shape, self.centers.shape, self.covariances.shape)
        if shapes != ((k,), (k, d), (k, d, d)):
            raise InputError(
                f"bumps of shapes {shapes} do not fit; give heights (k,), centers (k, {d}), covariances (k, {d}, {d})."
            )
        eigenvalues = np.linalg.eigvalsh(self.covariances)
        if not np.all(eigenvalues > 0.0):
            raise InputError(f"bump covariances must be positive definite; smallest eigenvalue {eigenvalues.min():g}.")
        self._precisions = _inverse(self.covariances)
        self._optimum = None if optimum is None else np.array(optimum, dtype=np.float64)

    @property
    def optimum(self) -> Optimum:
        """The highest value in the box and where it is; searched for when it was not given."""
        if self._optimum is None:
            self._optimum = highest(self, self.box, self.centers).x
        return Optimum(self._optimum.copy(), float(self(self._optimum)))

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the value at x (d,) as a float, or the values at x (n, d) as an array (n,)."""
        points, single = checked_points(x, self.box)
        values = _bumps(points, self.heights, self.centers, self._precisions)
        return float(values[0]) if single else values

    def expectation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return E f(x + xi), xi ~ `noise`, at x (d,) or (n, d), to about 1e-9."""
        points, single = checked_points(x, self.box)
        values = self._at_border(points, noise, self._moments(points, noise))[0]
        return float(values[0]) if single else values

    def standard_deviation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return the standard deviation of f(x + xi), xi ~ `noise`, at x (d,) or (n, d), to about 1e-9."""
        points, single = checked_points(x, self.box)
        values = self._at_border(points, noise, self._moments(points, noise, second=True))[1]
        return float(values[0]) if single else values

    def _at_border(self, points: NDArray[np.float64], noise: InputNoise, extended: Moments) -> Moments:
        return extended if self.border == "extend" else moments_at_border(self, points, self.box, noise, extended)

    def _moments(self, points: NDArray[np.float64], noise: InputNoise, second: bool = False) -> Moments:
        """Return E f and the standard deviation (NaN unless asked for) with the function extended beyond the box."""
        shaken = _covariance(noise, self.box)
        mean = _smoothed(points, self.heights, self.centers, self.covariances, shaken)
        if not second:
            return mean, np.full_like(mean, np.nan)
        squares = _smoothed(points, *self._square(), shaken)
        return mean, np.sqrt(np.maximum(squares - mean**2, 0.0))

    def _square(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return heights, centers and covariances of the k^2 bumps whose sum is f^2."""
        d = self.box.dimension
        precisions = self._precisions[:, None] + self._precisions[None, :]  # (k, k, d, d)
        covariances = _inverse(precisions)
        pulls = np.einsum("kij,kj->ki", self._precisions, self.centers)
        centers = np.einsum("abij,abj->abi", covariances, pulls[:, None] + pulls[None, :])
        apart = self.centers[:, None] - self.centers[None, :]
        sums = np.linalg.inv(self.covariances[:, None] + self.covariances[None, :])
        overlap = np.exp(-0.5 * np.einsum("abi,abij,abj->ab", apart, sums, apart))
        heights = np.outer(self.heights, self.heights) * overlap
        return heights.ravel(), centers.reshape(-1, d), covariances.reshape(-1, d, d)

    def __repr__(self) -> str:
        return f"<{self.name}: {self.heights.size} Gaussian bumps on {self.box!r}>"


def RKHS() -> GaussianBumps:
    """Return the 1-d function of Assael et al. 2014: two needle-sharp peaks and a broad, lower, safe hill on [0, 1].

    Maximum 5.7383937471 at 0.8924; under noise of standard deviation 0.01 the hill at 0.0776 (4.9382) is better.
    """
    broad_centers = [0.1, 0.15, 0.08, 0.3, 0.4]
    broad_heights = [4.0, -1.0, 2.0, -2.0, 1.0]
    sharp_centers = [0.8, 0.85, 0.9, 0.95, 0.92, 0.74, 0.91, 0.89, 0.79, 0.88, 0.86, 0.96, 0.99, 0.82]
    sharp_heights = [3.0, 4.0, 2.0, 1.0, -1.0, 2.0, 2.0, 3.0, 3.0, 2.0, -1.0, -2.0, 4.0, -3.0]
    widths = np.repeat([0.1, 0.01], [len(broad_centers), len(sharp_centers)])
    return GaussianBumps(
        "rkhs",
        Box({"x": (0.0, 1.0)}),
        heights=broad_heights + sharp_heights,
        centers=np.array(broad_centers + sharp_centers)[:, None],
        covariances=(widths**2)[:, None, None],
        optimum=[0.89235975462],
    )


def GM() -> GaussianBumps:
    """Return the 2-d mixture of six Gaussians on [0, 1]^2, z1 = 7 x1 - 1, z2 = 8 x2 - 4: a narrow peak beside a hill.

    Maximum 0.1356585721 at (0.1493, 0.2544); under noise of standard deviation 0.1 the broad hill at (0.4446, 0.4829)
    is better (0.0969296 against 0.0751050).
    """
    shares = np.array([0.2, 0.5, 0.5, 0.1, 0.5, 0.5])
    means = np.array([(1.5, 0.0), (3.0, 3.0), (4.0, -1.0), (0.0, -2.0), (2.0, 2.0), (2.0, -1.0)])
    eye = np.eye(2)
    shapes = np.array([eye, np.diag([5.0, 1.0]), [[2.0, 0.5], [0.5, 4.0]], 0.3 * eye, 10.0 * eye, 5.0 * eye])
    scale, shift = np.array([7.0, 8.0]), np.array([-1.0, -4.0])
    return GaussianBumps(
        "gm",
        Box({"x1": (0.0, 1.0), "x2": (0.0, 1.0)}),
        heights=shares / (np.sqrt(np.linalg.det(shapes)) * np.pi),
        centers=(means - shift) / scale,
        covariances=shapes / np.outer(scale, scale),
        optimum=[0.149291470, 0.254437784],
    )


class GF:
    """The 2-d function of Gramacy and Lee 2008 on [0, 1]^2: f = z1 exp(-z1^2 - z2^2), flat but for one corner.

    Parameters
    ----------
    stretched
        False: z = 8 x - 2, that is z in [-2, 6]^2; maximum at x = (0.3384, 0.25). True: z = 20 x - 2, that is
        z in [-2, 18]^2 (Assael et al. 2014), so that an initial design is likely to see nothing but zero.
        The maximum is 1 / sqrt(2 e) = 0.428881942480 in both.
    """

    def __init__(self, stretched: bool = False):
        self.name: Final[str] = "gf-stretched" if stretched else "gf"
        self.box: Final[Box] = Box({"x1": (0.0, 1.0), "x2": (0.0, 1.0)})
        self._scale = 20.0 if stretched else 8.0
        self._shift = -2.0

    @property
    def optimum(self) -> Optimum:
        """The highest value, 1 / sqrt(2 e) at z = (1 / sqrt 2, 0)."""
        z = np.array([np.sqrt(0.5), 0.0])
        return Optimum((z - self._shift) / self._scale, float(np.exp(-0.5) * np.sqrt(0.5)))

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the value at x (2,) as a float, or the values at x (n, 2) as an array (n,)."""
        points, single = checked_points(x, self.box)
        z = self._scale * points + self._shift
        values = z[:, 0] * np.exp(-np.sum(z**2, axis=1))
        return float(values[0]) if single else values

    def expectation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return E f(x + xi), xi ~ `noise`, at x (2,) or (n, 2), to about 1e-9."""
        points, single = checked_points(x, self.box)
        values = moments_at_border(self, points, self.box, noise, self._moments(points, noise))[0]
        return float(values[0]) if single else values

    def standard_deviation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return the standard deviation of f(x + xi), xi ~ `noise`, at x (2,) or (n, 2), to about 1e-9."""
        points, single = checked_points(x, self.box)
        values = moments_at_border(self, points, self.box, noise, self._moments(points, noise))[1]
        return float(values[0]) if single else values

    def _moments(self, points: NDArray[np.float64], noise: InputNoise) -> Moments:
        """Return E f and the standard deviation with the function extended beyond the box."""
        factor, mean, _ = self._tilted(points, noise, 2.0)
        factor_2, mean_2, variance_2 = self._tilted(points, noise, 4.0)
        first, second = factor * mean[:, 0], factor_2 * (mean_2[:, 0] ** 2 + variance_2)
        return first, np.sqrt(np.maximum(second - first**2, 0.0))

    def _tilted(self, points: NDArray[np.float64], noise: InputNoise, sharpness: float):
        """Write exp(-s |z|^2 / 2) Normal(z; m, S) as factor * Normal(z; mean, V): factor (n,), mean (n, 2), V_11."""
        m = self._scale * points + self._shift
        covariance = self._scale**2 * _covariance(noise, self.box)
        shrink = np.linalg.inv(np.eye(2) + sharpness * covariance)
        mean = m @ shrink.T
        factor = np.sqrt(np.linalg.det(shrink)) * np.exp(-0.5 * sharpness * np.sum(m * mean, axis=1))
        return factor, mean, float((shrink @ covariance)[0, 0])

    def __repr__(self) -> str:
        return f"<{self.name} on {self.box!r}>"


#: The synthetic functions by the name that the command line uses.
SYNTHETIC: Final[dict[str, Callable[[], GaussianBumps | GF]]] = {
    "rkhs": RKHS,
    "gm": GM,
    "gf": GF,
    "gf-stretched": lambda: GF(stretched=True),
}


def synthetic_function(name: str) -> GaussianBumps | GF:
    """Return the synthetic function of that name: rkhs, gm, gf or gf-stretched.

    Raises
    ------
    InputError
        If the name is not one of these.
    """
    if name not in SYNTHETIC:
        raise unknown_name("problem", name, SYNTHETIC)
    return SYNTHETIC[name]()


def robust_optimum(problem: GaussianBumps | GF, noise: InputNoise) -> Optimum:
    """Return the point of the box with the highest expectation under the noise, and that expectation.

    Search: a quasi-random net and the bumps' centers, then a bounded quasi-Newton climb from the best of them;
    accurate to about 1e-6 of the box in x.
    """
    starts = problem.centers if isinstance(problem, GaussianBumps) else np.empty((0, problem.box.dimension))
    return highest(lambda x: problem.expectation(x, noise), problem.box, starts)


def highest(f: Callable[[NDArray[np.float64]], object], box: Box, starts: NDArray[np.float64]) -> Optimum:
    """Return the highest value of f((n, d)) in the box and where it is: a net and `starts`, then climbs."""
    from scipy.optimize import minimize
    from scipy.stats import qmc

    net = box.from_unit(qmc.Sobol(box.dimension, scramble=False).random_base2(9))
    candidates = np.vstack([net, np.clip(starts, box.lower, box.upper)])
    values = np.asarray(f(candidates))
    bounds = list(zip(box.lower, box.upper, strict=True))
    climbs = [
        minimize(
            lambda x: -float(np.asarray(f(x))),
            candidates[i],
            bounds=bounds,
            method="L-BFGS-B",
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        for i in np.argsort(-values, kind="stable")[:5]
    ]
    best = min(climbs, key=lambda climb: float(climb.fun))
    return Optimum(np.asarray(best.x, dtype=np.float64), -float(best.fun))


def _covariance(noise: InputNoise, box: Box) -> NDArray[np.float64]:
    """Return the covariance (d, d) of the noise in the units of the box."""
    noise = needed_input_noise(noise, box.names)
    if not noise.kind.gaussian or noise.varies:
        raise InputError(
            f"{noise!r} has no closed form; use robust_score, or Gaussian noise that is the same everywhere."
        )
    return noise.unit_covariance(box) * np.outer(box.widths, box.widths)


def _inverse(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)


def _bumps(
    points: NDArray[np.float64],
    heights: NDArray[np.float64],
    centers: NDArray[np.float64],
    precisions: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return sum_k w_k exp(-(x - c_k)' P_k (x - c_k) / 2) at points (n, d)."""
    apart = points[:, None] - centers  # (n, k, d)
    squared = np.sum((apart[:, :, None, :] @ precisions)[:, :, 0] * apart, axis=-1)  # (n, k)
    return np.sum(np.exp(-0.5 * squared) * heights, axis=-1)  # not BLAS: each row rounds alike, however many there are


def _smoothed(
    points: NDArray[np.float64],
    heights: NDArray[np.float64],
    centers: NDArray[np.float64],
    covariances: NDArray[np.float64],
    noise: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the expectation of the bumps at points (n, d) shaken by N(0, noise)."""
    wider = covariances + noise
    shrink = np.sqrt(np.linalg.det(covariances) / np.linalg.det(wider))
    return _bumps(points, heights * shrink, centers, _inverse(wider))
