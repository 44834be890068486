"""Input noise given as samples: measured errors, skewed or with several modes, of any distribution.

Legend: N samples e_k (N, d) of reached - commanded, in the box's units, all equally likely; their mean is part of it.

Averages are taken over the samples themselves where they are few, else over representatives: the samples are halved
at the median of the coordinate that is widest in the cube, the halves again, and so on; each part is represented by its
mean, with the weight of its share. Mean and, after a common stretch of each coordinate, variances are those of the
samples.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.amounts import amount
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.kinds import Root
from surehold.optimization.noise.quadratures import Quadrature, quadrature

__all__ = ["Samples", "checked_samples", "representatives"]

_LEAST: Final = 2  # samples
_RIDGE: Final = 1e-9  # share by which variances are raised, so that a root exists


@dataclass(frozen=True, repr=False, eq=False)
class Samples:
    """Noise by samples."""

    errors: NDArray[np.float64]
    """(N, d), reached - commanded, in the box's units and the order of its names"""
    gaussian, bounded, varies = False, False, False

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d) of the samples around their mean."""
        unit = self._unit(box)
        apart = unit - unit.mean(axis=0)
        covariance = apart.T @ apart / len(unit)
        return covariance + np.diag(_RIDGE * np.diag(covariance))  # samples may lie on a line

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean of the samples (d,) in the unit cube."""
        return self._unit(box).mean(axis=0)

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n of the samples (n, d), drawn with replacement."""
        unit = self._unit(box)
        return unit[rng.integers(len(unit), size=n)]

    def quadrature(self, box: Box, rule: str, k: float, exponent: int) -> tuple[Quadrature, Root | None]:
        """Return the quadrature of a rule: sigma points around the mean, or 2**exponent representatives.

        Raises InputError for "gauss_hermite", which is of normal and uniform noise.
        """
        unit = self._unit(box)
        if rule == "gauss_hermite":
            raise InputError(
                "the quadrature 'gauss_hermite' is for normal and uniform noise; samples take 'quasi_monte_carlo', "
                "which averages over representative ones."
            )
        if rule == "quasi_monte_carlo":
            return representatives(unit, 2**exponent), None
        points = quadrature(rule, self.unit_covariance(box), k, exponent=exponent)
        return points._replace(offsets=points.offsets + unit.mean(axis=0)), None

    def _unit(self, box: Box) -> NDArray[np.float64]:
        if self.errors.shape[1] != box.dimension:
            raise InputError(
                f"samples of input noise have {self.errors.shape[1]} columns, but the box has {box.dimension} "
                f"variables ({', '.join(box.names)}); give one column a variable."
            )
        return self.errors / box.widths

    def __repr__(self) -> str:
        return f"InputNoise.samples({len(self.errors)} x {self.errors.shape[1]})"


def checked_samples(samples: ArrayLike, what: str = "samples of input noise") -> NDArray[np.float64]:
    """Return samples (N, d), those of one variable (N,) as one column.

    Raises InputError where they are no finite numbers, fewer than two, or all equal.
    """
    try:
        array = np.array(samples, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} are no numbers; give an array (N, d), one row a sample.") from None
    array = array[:, None] if array.ndim == 1 else array
    shape = InputError(f"{what} have shape {array.shape}; give two or more rows, (N, d), one column a variable.")
    if array.ndim != 2 or array.size == 0:
        raise shape
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise InputError(f"{what} hold {array[row].tolist()} in row {row}; every one must be a finite number.")
    if len(array) < _LEAST:
        raise shape
    if np.all(array == array[0]):
        rows, columns = array.shape
        raise InputError(
            f"{what} are all equal, {rows} rows of {amount(columns, 'column')} for as many "
            "variables: an offset is no noise; give errors as they were measured."
        )
    array.flags.writeable = False
    return array


def representatives(samples: NDArray[np.float64], count: int) -> Quadrature:
    """Return up to `count` points that stand for samples (N, d): offsets (s, d) and weights (s,)."""
    n, d = samples.shape
    if n <= count:
        return Quadrature(samples.copy(), np.full(n, 1.0 / n))
    parts = [np.arange(n)]
    while len(parts) < count:
        largest = max(range(len(parts)), key=lambda i: (len(parts[i]), -i))
        part = parts.pop(largest)
        axis = int(np.argmax(np.ptp(samples[part], axis=0)))
        order = part[np.argsort(samples[part, axis], kind="stable")]
        half = (len(order) + 1) // 2
        parts += [order[:half], order[half:]]
    offsets = np.array([samples[part].mean(axis=0) for part in parts])
    weights = np.array([len(part) / n for part in parts])
    mean = samples.mean(axis=0)
    apart = offsets - mean
    spread = np.sqrt(weights @ apart**2)
    stretch = np.divide(samples.std(axis=0), spread, out=np.ones(d), where=spread > 0.0)
    return Quadrature(mean + stretch * apart, weights)
