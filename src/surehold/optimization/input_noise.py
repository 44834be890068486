"""How far the reached input strays from the commanded one: a zero-mean Gaussian over the variables of a box."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box

__all__ = ["InputNoise"]


class InputNoise:
    """Gaussian input noise: reached = commanded + N(0, covariance).

    Parameters
    ----------
    standard_deviations
        `{name: standard deviation}` in the box's units, one entry a variable; 0 means that the variable is exact.
    covariance
        Instead: a (d, d) symmetric positive definite matrix in the box's units, in the order of the box's names.

    Raises
    ------
    InputError
        If a standard deviation is negative or not finite, the covariance is not symmetric positive definite, or
        both or neither are given. Names and size are checked against a box in `unit_covariance`.

    Examples
    --------
    >>> box = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
    >>> InputNoise({"dx": 0.003, "dy": 0.003}).unit_covariance(box).diagonal() ** 0.5
    array([0.03, 0.05])
    >>> InputNoise.unit(0.03).unit_covariance(box).diagonal() ** 0.5
    array([0.03, 0.03])
    """

    def __init__(self, standard_deviations: Mapping[str, float] | None = None, *, covariance: ArrayLike | None = None):
        if (standard_deviations is None) == (covariance is None):
            raise InputError(
                "input noise needs either standard deviations {name: value} or covariance=, not both or neither."
            )
        self._deviations = None if standard_deviations is None else _checked_deviations(standard_deviations)
        self._covariance = None if covariance is None else _checked_covariance(covariance)
        self._unit: float | None = None

    @classmethod
    def unit(cls, standard_deviation: float) -> "InputNoise":
        """Return noise of the same `standard_deviation` in every variable, as a fraction of the box (0.03 = 3 %)."""
        value = _checked_deviation("every variable", standard_deviation)
        if value == 0.0:
            raise InputError("input noise of 0 in every variable is no noise; pass input_noise=None.")
        noise = cls.__new__(cls)
        noise._deviations = noise._covariance = None
        noise._unit = value
        return noise

    def unit_covariance(self, box: Box) -> NDArray[np.float64]:
        """Return the covariance (d, d) in the unit cube of `box`.

        Raises
        ------
        InputError
            If names are unknown or missing, or the covariance has the wrong size for the box.
        """
        if self._unit is not None:
            return np.eye(box.dimension) * self._unit**2
        if self._covariance is not None:
            if self._covariance.shape[0] != box.dimension:
                raise InputError(
                    f"input-noise covariance has {self._covariance.shape[0]} rows, but the box has {box.dimension} "
                    f"variables ({', '.join(box.names)}); give a {box.dimension} x {box.dimension} matrix."
                )
            return self._covariance / np.outer(box.widths, box.widths)
        deviations = self._deviations or {}
        for name in deviations:
            if name not in box.names:
                raise unknown_name("input-noise variable", name, box.names)
        missing = [name for name in box.names if name not in deviations]
        if missing:
            raise InputError(
                f"input noise says nothing about {', '.join(missing)}; give a standard deviation for each variable "
                "(0 for one that is reached exactly)."
            )
        return np.diag((np.array([deviations[name] for name in box.names]) / box.widths) ** 2)

    def __repr__(self) -> str:
        if self._unit is not None:
            return f"InputNoise.unit({self._unit:g})"
        if self._covariance is not None:
            return f"InputNoise(covariance={self._covariance.tolist()})"
        return f"InputNoise({self._deviations})"


def _checked_deviation(name: str, value: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number) or number < 0.0:
        raise InputError(f"input noise of {name} is {value!r}; a standard deviation is a finite number of 0 or more.")
    return number


def _checked_deviations(deviations: Mapping[str, float]) -> dict[str, float]:
    if not isinstance(deviations, Mapping) or len(deviations) == 0:
        raise InputError(f"input noise is {deviations!r}; give {{name: standard deviation}}, or InputNoise.unit(0.03).")
    checked = {name: _checked_deviation(f"'{name}'", value) for name, value in deviations.items()}
    if all(value == 0.0 for value in checked.values()):
        raise InputError("input noise of 0 in every variable is no noise; pass input_noise=None.")
    return checked


def _checked_covariance(covariance: ArrayLike) -> NDArray[np.float64]:
    try:
        matrix = np.array(covariance, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"input-noise covariance {covariance!r} is not a numeric matrix.") from None
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.size == 0:
        raise InputError(f"input-noise covariance has shape {matrix.shape}; it must be square (d, d).")
    if not np.all(np.isfinite(matrix)):
        raise InputError("input-noise covariance holds NaN or infinity; every entry must be finite.")
    if not np.allclose(matrix, matrix.T, rtol=1e-10, atol=0.0):
        raise InputError("input-noise covariance is not symmetric; entry (i, j) must equal entry (j, i).")
    eigenvalues = np.linalg.eigvalsh(matrix)
    if eigenvalues[0] <= 1e-12 * max(eigenvalues[-1], 0.0) or eigenvalues[-1] <= 0.0:
        raise InputError(
            f"input-noise covariance is not positive definite (smallest eigenvalue {eigenvalues[0]:g}); "
            "give standard deviations, with 0 for exact variables, if some variables carry no noise."
        )
    matrix.flags.writeable = False
    return matrix
