"""How far the reached input strays from the commanded one: its distribution over the variables of a box."""

import warnings
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.gaussian import (
    Correlated,
    Independent,
    ShareOfBox,
    checked_covariance,
    checked_deviation,
    checked_deviations,
)
from surehold.optimization.noise.kinds import Kind, root_of
from surehold.optimization.noise.samples import Samples, checked_samples
from surehold.optimization.noise.uniform import Uniform
from surehold.optimization.noise.varying import Varying

__all__ = ["InputNoise", "checked_input_noise", "needed_input_noise", "noise_of_coordinates"]

_NO_NOISE: Final = "input noise of 0 in every variable is no noise; pass input_noise=None."


class InputNoise:
    """Input noise: reached = commanded + N(0, covariance).

    `InputNoise.uniform` is bounded noise, `InputNoise.varying` noise that differs from place to place,
    `InputNoise.samples` noise of any distribution, by measured errors.

    Parameters
    ----------
    standard_deviations
        `{name: standard deviation}` in the box's units, one entry a variable; 0 means that the variable is exact.
    covariance
        Instead: a (d, d) symmetric matrix in the box's units, in the order of the box's names, positive definite but
        for zero rows and columns of exact variables. Variances may be of any scale (1e-10 m^2 beside 400 K^2).

    Attributes
    ----------
    kind
        The kind of noise, see `kinds.Kind`.

    Raises
    ------
    InputError
        If a standard deviation is negative or not finite, the covariance is not such a matrix, or both or neither are
        given. Names and size are checked against a box in `unit_covariance`.

    Examples
    --------
    >>> box = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
    >>> InputNoise({"dx": 0.003, "dy": 0.003}).unit_covariance(box).diagonal() ** 0.5
    array([0.03, 0.05])
    >>> InputNoise.unit(0.03).unit_covariance(box).diagonal() ** 0.5
    array([0.03, 0.03])
    """

    kind: Kind

    def __init__(self, standard_deviations: Mapping[str, float] | None = None, *, covariance: ArrayLike | None = None):
        if (standard_deviations is None) == (covariance is None):
            raise InputError(
                "input noise needs either standard deviations {name: value} or covariance=, not both or neither."
            )
        if standard_deviations is not None:
            self.kind = Independent(_some(checked_deviations(standard_deviations)))
        elif covariance is not None:
            matrix = checked_covariance(covariance)
            if not matrix.any():
                raise InputError(_NO_NOISE)
            self.kind = Correlated(matrix)

    @classmethod
    def _of(cls, kind: Kind) -> "InputNoise":
        noise = cls.__new__(cls)
        noise.kind = kind
        return noise

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
        checked = _some(checked_deviations(half_widths))
        return cls._of(Uniform({name: value / 3.0**0.5 for name, value in checked.items()}))

    @classmethod
    def varying(cls, function: Callable[[NDArray[np.float64]], Any]) -> "InputNoise":
        """Return Gaussian noise that depends on the input: function(x (d,)), in the box's units.

        It returns what the constructor takes at that place: {name: standard deviation}, standard deviations (d,), or a
        covariance (d, d); zeros where there is no noise. What it returns is checked when it is used.
        Beside uncontrolled variables it is asked under each condition; what it says of their own noise is passed over.
        """
        if not callable(function):
            raise InputError(f"input noise is {function!r}; give a function of x (d,) that returns the noise there.")
        return cls._of(Varying(function))

    @classmethod
    def samples(cls, errors: ArrayLike) -> "InputNoise":
        """Return noise of any distribution, given as errors (N, d) that were measured: reached - commanded.

        In the box's units and the order of its names; (N,) for one variable. They may be skewed, have several modes,
        and a mean: as a rig that always falls short would make them. Every error is equally likely. Raises InputError
        where they are no finite numbers, fewer than two, or all equal.

        Examples
        --------
        >>> InputNoise.samples([0.0, 0.0, 0.0, -0.004]).unit_covariance(Box({"dx": (-0.05, 0.05)})).round(6)
        array([[0.0003]])
        """
        return cls._of(Samples(checked_samples(errors)))

    @classmethod
    def unit(cls, standard_deviation: float) -> "InputNoise":
        """Return noise of the same `standard_deviation` in every variable, as a fraction of the box (0.03 = 3 %)."""
        if np.ndim(standard_deviation) > 0:
            raise InputError(
                f"InputNoise.unit takes one share of the box for every variable, not {standard_deviation!r}; for one "
                "each, in the box's units: InputNoise({name: standard deviation})."
            )
        value = checked_deviation("every variable", standard_deviation)
        if value == 0.0:
            raise InputError(_NO_NOISE)
        return cls._of(ShareOfBox(value))

    @property
    def bounded(self) -> bool:
        """Whether the noise is uniform within half-widths."""
        return self.kind.bounded

    @property
    def varies(self) -> bool:
        """Whether the noise differs from place to place."""
        return self.kind.varies

    def to_json(self) -> dict[str, Any]:
        """Return constant noise as plain data, for `from_json`; raises InputError for noise that varies."""
        kind = self.kind
        if isinstance(kind, Independent | Uniform):
            return {"standard_deviations": dict(kind.deviations), "bounded": kind.bounded}
        if isinstance(kind, ShareOfBox):
            return {"unit": kind.deviation}
        if isinstance(kind, Correlated):
            return {"covariance": kind.covariance.tolist()}
        if isinstance(kind, Samples):
            return {"samples": kind.errors.tolist()}
        raise InputError(f"{self!r} is a function, which plain data cannot hold; give constant noise.")

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "InputNoise":
        """Return the noise that `to_json` described."""
        if "unit" in data:
            return cls.unit(data["unit"])
        if "samples" in data:
            return cls.samples(data["samples"])
        if data.get("bounded"):
            return cls._of(Uniform(_some(checked_deviations(data["standard_deviations"]))))
        return cls(data.get("standard_deviations"), covariance=data.get("covariance"))

    def unit_covariance(self, box: Box, x: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d) in the unit cube of `box`.

        Noise that varies is asked at x (d,), in the box's units; in the middle of the box where x is None.

        Raises
        ------
        InputError
            If names are unknown or missing, the covariance has the wrong size for the box, or the function of varying
            noise returns something else than noise.
        """
        return self.kind.unit_covariance(box, None if x is None else np.asarray(x, dtype=np.float64))

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean (d,) in the unit cube of `box`: by how much all trials stray alike. 0 but for samples."""
        return self.kind.unit_mean(box)

    def unit_roots(self, box: Box, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return lower triangular R (q, d, d) with R R' = covariance at points U (q, d) of the unit cube."""
        if not self.varies:
            return np.broadcast_to(root_of(self.unit_covariance(box)), (len(U), box.dimension, box.dimension))
        return np.array([root_of(self.unit_covariance(box, x)) for x in box.from_unit(np.clip(U, 0.0, 1.0))])

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d) of the noise at a point u (d,) of the unit cube, or one at each of n points (n, d)."""
        return self.kind.draws(box, u, n, rng)

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

    def __repr__(self) -> str:
        return repr(self.kind)


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


def needed_input_noise(value: Any, names: tuple[str, ...]) -> InputNoise:
    """Return input noise where there must be some; raises InputError if it is none."""
    noise = checked_input_noise(value, names)
    if noise is None:
        raise InputError(f"the input noise is None; give sh.InputNoise({{name: deviation}}) for {', '.join(names)}.")
    return noise


def noise_of_coordinates(noise: InputNoise | None, box: Box) -> InputNoise | None:
    """Return noise that was given for the numbers of a box as noise of its coordinates, none on choices.

    Raises
    ------
    InputError
        If it is no input noise, its names are not those of the numbers, or choices meet noise that varies.
    """
    numbers = box.numbers
    noise = checked_input_noise(noise, () if numbers is None else numbers.names)
    if noise is None or (numbers is not None and numbers.dimension == box.dimension):
        return noise
    if numbers is None:
        raise InputError("input noise is given, but all variables are choices, which carry none; leave it out.")
    if noise.varies:
        raise InputError("input noise varies from place to place, and some variables are choices; give constants.")
    own = [box.names.index(name) for name in numbers.names]
    if isinstance(noise.kind, Samples):
        errors = np.zeros((len(noise.kind.errors), box.dimension))
        errors[:, own] = noise.kind.errors
        return InputNoise.samples(errors)
    covariance = noise.unit_covariance(numbers)
    if isinstance(noise.kind, Correlated):
        matrix = np.zeros((box.dimension, box.dimension))
        matrix[np.ix_(own, own)] = noise.kind.covariance
        return InputNoise(covariance=matrix)
    deviations = dict.fromkeys(box.names, 0.0)
    deviations |= dict(zip(numbers.names, (np.sqrt(np.diag(covariance)) * numbers.widths).tolist(), strict=True))
    if noise.bounded:
        return InputNoise.uniform({name: 3.0**0.5 * deviation for name, deviation in deviations.items()})
    return InputNoise(deviations)


def _some(deviations: dict[str, float]) -> dict[str, float]:
    if all(value == 0.0 for value in deviations.values()):
        raise InputError(_NO_NOISE)
    return deviations
