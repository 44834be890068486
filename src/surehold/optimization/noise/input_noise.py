"""How far the reached input strays from the commanded one: its distribution over the variables of a box."""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box

__all__ = ["InputNoise", "checked_input_noise"]


class InputNoise:
    """Input noise: reached = commanded + N(0, covariance).

    `InputNoise.uniform` is bounded noise, `InputNoise.varying` noise that differs from place to place.

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
        self._function: Callable[[NDArray[np.float64]], Any] | None = None
        self.bounded = False

    @classmethod
    def uniform(cls, half_widths: Mapping[str, float]) -> "InputNoise":
        """Return bounded noise, equally likely anywhere within plus and minus `half_widths` {name: value}.

        In the box's units, one entry a variable; 0 means that the variable is exact. Raises InputError for half-widths
        that are negative or not finite.

        Examples
        --------
        >>> box = Box({"dx": (-0.05, 0.05)})
        >>> InputNoise.uniform({"dx": 0.003}).unit_covariance(box)
        array([[0.0003]])
        """
        noise = cls({name: value / 3.0**0.5 for name, value in _checked_deviations(half_widths).items()})
        noise.bounded = True
        return noise

    @classmethod
    def varying(cls, function: Callable[[NDArray[np.float64]], Any]) -> "InputNoise":
        """Return Gaussian noise that depends on the input: function(x (d,)), in the box's units.

        It returns what the constructor takes at that place: {name: standard deviation}, standard deviations (d,), or a
        covariance (d, d); which variables are exact must not depend on x. What it returns is checked when it is used.
        """
        if not callable(function):
            raise InputError(f"input noise is {function!r}; give a function of x (d,) that returns the noise there.")
        noise = cls.unit(1.0)
        noise._unit = None
        noise._function = function
        return noise

    @property
    def varies(self) -> bool:
        """Whether the noise differs from place to place."""
        return self._function is not None

    @classmethod
    def unit(cls, standard_deviation: float) -> "InputNoise":
        """Return noise of the same `standard_deviation` in every variable, as a fraction of the box (0.03 = 3 %)."""
        value = _checked_deviation("every variable", standard_deviation)
        if value == 0.0:
            raise InputError("input noise of 0 in every variable is no noise; pass input_noise=None.")
        noise = cls.__new__(cls)
        noise._deviations = noise._covariance = noise._function = None
        noise._unit = value
        noise.bounded = False
        return noise

    def to_json(self) -> dict[str, Any]:
        """Return constant noise as plain data, for `from_json`; raises InputError for noise that varies."""
        if self._function is not None:
            raise InputError(f"{self!r} is a function, which plain data cannot hold; give constant noise.")
        covariance = None if self._covariance is None else self._covariance.tolist()
        data = {"standard_deviations": self._deviations, "covariance": covariance, "unit": self._unit}
        return {name: value for name, value in data.items() if value is not None} | {"bounded": self.bounded}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "InputNoise":
        """Return the noise that `to_json` described."""
        if "unit" in data:
            return cls.unit(data["unit"])
        noise = cls(data.get("standard_deviations"), covariance=data.get("covariance"))
        noise.bounded = bool(data["bounded"])
        return noise

    def unit_covariance(self, box: Box, x: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d) in the unit cube of `box`.

        Noise that varies is asked at x (d,), in the box's units; in the middle of the box where x is None.

        Raises
        ------
        InputError
            If names are unknown or missing, the covariance has the wrong size for the box, or the function of varying
            noise returns something else than noise.
        """
        if self._function is not None:
            place = box.from_unit(np.full(box.dimension, 0.5)) if x is None else np.asarray(x, dtype=np.float64)
            return self._at(place, box).unit_covariance(box)
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

    def unit_roots(self, box: Box, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return lower triangular R (q, d, d) with R R' = covariance at points U (q, d) of the unit cube."""
        if self._function is None:
            return np.broadcast_to(root_of(self.unit_covariance(box)), (len(U), box.dimension, box.dimension))
        return np.array([root_of(self.unit_covariance(box, x)) for x in box.from_unit(np.clip(U, 0.0, 1.0))])

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d) of the noise at a point u (d,) of the unit cube."""
        root = self.unit_roots(box, u[None, :])[0]
        shape = (n, box.dimension)
        standard = rng.uniform(-(3.0**0.5), 3.0**0.5, shape) if self.bounded else rng.standard_normal(shape)
        return standard @ root.T

    def warn_if_larger_than(self, box: Box) -> None:
        """Warn of variables whose standard deviation is more than half of the box."""
        deviation = np.sqrt(np.diag(self.unit_covariance(box)))
        for name, width, share in zip(box.names, box.widths, deviation, strict=True):
            if share > 0.5:
                warnings.warn(
                    f"input noise of {name} has a standard deviation of {share * width:.3g}, {share:.1f} times the "
                    "box: wherever it is commanded, the reached input may be anywhere in the box and beyond, so that "
                    "hardly any place is safer than another. Check its unit, or give a wider box.",
                    stacklevel=3,
                )

    def _at(self, x: NDArray[np.float64], box: Box) -> "InputNoise":
        """Return the noise that the user's function states at x (d,), checked."""
        assert self._function is not None
        stated = self._function(x)
        try:
            if isinstance(stated, Mapping):
                return InputNoise(stated)
            array = np.asarray(stated, dtype=np.float64)
            if array.shape == (box.dimension,):
                return InputNoise(dict(zip(box.names, array.tolist(), strict=True)))
            if array.shape == (box.dimension, box.dimension):
                return InputNoise(covariance=array)
        except (TypeError, ValueError) as error:  # InputError is a ValueError
            raise InputError(f"the input-noise function returned nonsense at {box.as_dict(x)}: {error}") from None
        raise InputError(
            f"the input-noise function returned an array of shape {array.shape} at {box.as_dict(x)}; it must return "
            f"{{name: standard deviation}}, ({box.dimension},) or ({box.dimension}, {box.dimension})."
        )

    def __repr__(self) -> str:
        if self._function is not None:
            return f"InputNoise.varying({getattr(self._function, '__name__', self._function)!r})"
        if self.bounded and self._deviations is not None:
            half_widths = {name: round(3.0**0.5 * value, 12) for name, value in self._deviations.items()}
            return f"InputNoise.uniform({half_widths})"
        if self._unit is not None:
            return f"InputNoise.unit({self._unit:g})"
        if self._covariance is not None:
            return f"InputNoise(covariance={self._covariance.tolist()})"
        return f"InputNoise({self._deviations})"


def checked_input_noise(value: Any, names: tuple[str, ...]) -> InputNoise | None:
    """Return input noise as it was given; raises InputError if it is none. `names` are those of the variables."""
    if value is None or isinstance(value, InputNoise):
        return value
    shown = f"input_noise is {' '.join(repr(value).split())}"
    if isinstance(value, Mapping):
        raise InputError(f"{shown}; give sh.InputNoise({dict(value)!r}).")
    if np.ndim(value) == 0 and isinstance(value, (int, float, np.number)):
        named = ", ".join(f"{name!r}: {value:g}" for name in names)
        raise InputError(
            f"{shown}, and it does not say of what: give sh.InputNoise.unit({value:g}) for that share of every "
            f"variable's range, or sh.InputNoise({{{named}}}) for standard deviations in the variables' own units."
        )
    raise InputError(f"{shown}; give sh.InputNoise({{name: standard deviation}}) for {', '.join(names)}, or None.")


def root_of(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return L (d, d) with L L' = covariance; variables without noise have zero rows."""
    shaken = np.flatnonzero(np.diag(covariance) > 0.0)
    root = np.zeros_like(covariance)
    root[np.ix_(shaken, shaken)] = np.linalg.cholesky(covariance[np.ix_(shaken, shaken)])
    return root


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
