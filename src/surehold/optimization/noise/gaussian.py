"""Gaussian input noise that is the same everywhere: by standard deviations, by a share of the box, by a covariance."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.kinds import Root, root_of
from surehold.optimization.noise.quadratures import Quadrature, quadrature
from surehold.optimization.values import LARGEST_SQUARED

__all__ = ["Correlated", "Independent", "ShareOfBox", "checked_covariance", "checked_deviations", "in_order"]

_SINGULAR = 1e-12  # smallest eigenvalue of a matrix of correlations that counts as positive


class _Gaussian(ABC):
    """What the three have in common."""

    gaussian, bounded, varies = True, False, False

    @abstractmethod
    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]: ...

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean (d,), which is 0."""
        return np.zeros(box.dimension)

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d)."""
        return rng.standard_normal((n, box.dimension)) @ root_of(self.unit_covariance(box)).T

    def quadrature(self, box: Box, rule: str, k: float, exponent: int) -> tuple[Quadrature, Root | None]:
        """Return the quadrature of a rule."""
        return quadrature(rule, self.unit_covariance(box), k, exponent=exponent), None


@dataclass(frozen=True, repr=False)
class Independent(_Gaussian):
    """Noise by the standard deviation of every variable."""

    deviations: Mapping[str, float]
    """{name: standard deviation} in the box's units, 0 for exact variables"""

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d)."""
        return np.diag((in_order(self.deviations, box) / box.widths) ** 2)

    def __repr__(self) -> str:
        return f"InputNoise({dict(self.deviations)})"


@dataclass(frozen=True, repr=False)
class ShareOfBox(_Gaussian):
    """Noise of the same share of the box in every variable."""

    deviation: float
    """standard deviation in widths of the box"""

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d)."""
        return np.eye(box.dimension) * self.deviation**2

    def __repr__(self) -> str:
        return f"InputNoise.unit({self.deviation:g})"


@dataclass(frozen=True, repr=False, eq=False)
class Correlated(_Gaussian):
    """Noise by its covariance."""

    covariance: NDArray[np.float64]
    """(d, d) in the box's units, in the order of the box's names; zero rows and columns for exact variables"""

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d)."""
        if len(self.covariance) != box.dimension:
            raise InputError(
                f"input-noise covariance has {len(self.covariance)} rows, but the box has {box.dimension} variables "
                f"({', '.join(box.names)}); give a {box.dimension} x {box.dimension} matrix."
            )
        return self.covariance / np.outer(box.widths, box.widths)

    def __repr__(self) -> str:
        return f"InputNoise(covariance={self.covariance.tolist()})"


def in_order(deviations: Mapping[str, float], box: Box) -> NDArray[np.float64]:
    """Return standard deviations (d,) in the order of the box; raises InputError for names that do not fit."""
    for name in deviations:
        if name not in box.names:
            raise unknown_name("input-noise variable", name, box.names)
    missing = [name for name in box.names if name not in deviations]
    if missing:
        raise InputError(
            f"input noise says nothing about {', '.join(missing)}; give a standard deviation for each variable "
            "(0 for one that is reached exactly)."
        )
    return np.array([deviations[name] for name in box.names])


def checked_deviation(name: str, value: float) -> float:
    """Return a standard deviation; raises InputError if it is negative, not finite or not a number."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not 0.0 <= number <= LARGEST_SQUARED:
        raise InputError(
            f"input noise of {name} is {value!r}; a standard deviation is a finite number of 0 or more, up to "
            f"{LARGEST_SQUARED:g}."
        )
    return number


def checked_deviations(deviations: Mapping[str, float]) -> dict[str, float]:
    """Return {name: standard deviation}; raises InputError if it is none."""
    if not isinstance(deviations, Mapping) or len(deviations) == 0:
        raise InputError(f"input noise is {deviations!r}; give {{name: standard deviation}}, or InputNoise.unit(0.03).")
    return {name: checked_deviation(f"'{name}'", value) for name, value in deviations.items()}


def checked_covariance(covariance: ArrayLike) -> NDArray[np.float64]:
    """Return a covariance (d, d); raises InputError if it is none.

    Symmetry and definiteness are those of the correlations, so that variances of any scale may stand side by side.
    """
    try:
        matrix = np.array(covariance, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"input-noise covariance {covariance!r} is not a numeric matrix.") from None
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.size == 0:
        raise InputError(f"input-noise covariance has shape {matrix.shape}; it must be square (d, d).")
    if not np.all(np.isfinite(matrix)):
        raise InputError("input-noise covariance holds NaN or infinity; every entry must be finite.")
    variances = np.diag(matrix)
    shaken = variances > 0.0
    if np.any(variances < 0.0) or matrix[~shaken].any() or matrix[:, ~shaken].any():
        raise InputError(
            "input-noise covariance is not positive definite: a variance is negative, or a variable of variance 0 has "
            "covariances; give exact variables a row and a column of zeros."
        )
    deviations = np.sqrt(variances[shaken])
    correlations = matrix[np.ix_(shaken, shaken)] / deviations[:, None] / deviations
    if np.any(np.abs(correlations - correlations.T) > 1e-10):
        raise InputError("input-noise covariance is not symmetric; entry (i, j) must equal entry (j, i).")
    if shaken.any() and (smallest := np.linalg.eigvalsh(correlations)[0]) <= _SINGULAR:
        raise InputError(
            f"input-noise covariance is not positive definite (smallest eigenvalue of its correlations {smallest:g}); "
            "variables that move exactly together cannot be told apart: give standard deviations, or less correlation."
        )
    matrix = 0.5 * (matrix + matrix.T)
    matrix.flags.writeable = False
    return matrix
