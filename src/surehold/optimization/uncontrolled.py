"""Conditions that are drawn or measured, not set: a payload, a friction, a temperature.

Legend: u uncontrolled variables among the d of a box; N samples of them, equally likely, in the unit cube, (N, u).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.variables import Number, Variable

__all__ = ["Conditions", "bounds_of", "conditions_of"]

_JOINT: Final = 10  # log2 of the samples that stand for several independent variables, or for a distribution
_TAIL: Final = 1e-3  # probability at either end of a distribution beyond the bounds that are taken from it

Groups = dict[tuple[str, ...], Any]


@dataclass(frozen=True, eq=False)
class Conditions:
    """How the uncontrolled variables of a box are distributed."""

    held: NDArray[np.bool_]
    """which variables they are, (d,)"""
    samples: NDArray[np.float64]
    """(N, u), in the unit cube"""
    values: NDArray[np.float64]
    """the same (N, u) in the box's units"""

    @property
    def mean(self) -> NDArray[np.float64]:
        """Their mean, (u,)."""
        return self.samples.mean(axis=0)

    def at_mean(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (..., d) with their uncontrolled variables at the mean."""
        U = np.array(U, dtype=np.float64)
        U[..., self.held] = self.mean
        return U


def bounds_of(bounds: Mapping[str, Any], uncontrolled: Mapping[Any, Any] | None) -> dict[str, Any]:
    """Return bounds with those of uncontrolled variables that have none added: the range of what they take.

    Raises InputError for an uncontrolled variable that is neither samples nor a distribution.
    """
    found = dict(bounds)
    for names, given in _groups(uncontrolled).items():
        for i, name in enumerate(names):
            if name in found:
                continue
            if hasattr(given, "ppf"):
                lower, upper = (float(given.ppf(level)) for level in (_TAIL, 1.0 - _TAIL))
            else:
                lower, upper = float(given[:, i].min()), float(given[:, i].max())
            found[name] = (lower, upper)
    return found


def conditions_of(
    variables: Sequence[Variable],
    names: tuple[str, ...],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    uncontrolled: Mapping[Any, Any] | None,
) -> Conditions | None:
    """Return the distribution of the uncontrolled variables of a box, None where there are none; names of coordinates.

    Raises InputError where one is no plain number, samples lie outside the bounds, or nothing is left to be controlled.
    """
    groups = _groups(uncontrolled)
    if not groups:
        return None
    _check_plain(variables, groups)
    if len(groups) == 1 and not hasattr(next(iter(groups.values())), "ppf"):
        columns = dict(zip(next(iter(groups)), next(iter(groups.values())).T, strict=True))
    else:
        columns = _independent(groups)
    held = np.array([name in columns for name in names])
    if held.all():
        raise InputError(f"all variables are uncontrolled ({', '.join(names)}); leave at least one to be chosen.")
    samples, kept = [], []
    for name, low, high in zip(names, lower, upper, strict=True):
        if name not in columns:
            continue
        values = columns[name]
        beyond = max(low - values.min(), values.max() - high)
        drawn = any(hasattr(given, "ppf") and name in group for group, given in groups.items())
        if beyond > 1e-9 * (high - low) and not drawn:
            raise InputError(
                f"samples of '{name}' reach from {values.min():g} to {values.max():g}, but its bounds are ({low:g}, "
                f"{high:g}); widen them, or leave them out."
            )
        kept.append(np.clip(values, low, high))
        samples.append((kept[-1] - low) / (high - low))
    return Conditions(held, np.stack(samples, axis=1), np.stack(kept, axis=1))


def _check_plain(variables: Sequence[Variable], groups: Groups) -> None:
    """Raise InputError where an uncontrolled variable is in steps, logarithmic or a choice: samples are coordinates."""
    for variable in variables:
        if not any(variable.name in group for group in groups):
            continue
        if not isinstance(variable, Number):
            raise InputError(f"'{variable.name}' is uncontrolled, but a choice; leave it out, or give it numbers.")
        if variable.log or variable.step:
            kind = "logarithmic" if variable.log else "in steps"
            raise InputError(
                f"'{variable.name}' is uncontrolled, but {kind}; its bounds are ({variable.low:g}, {variable.high:g}) "
                "alone, or left out."
            )


def _groups(uncontrolled: Mapping[Any, Any] | None) -> Groups:
    """Return {(name, ...): distribution, or samples (N, number of names)}."""
    if uncontrolled is None:
        return {}
    if not isinstance(uncontrolled, Mapping) or not uncontrolled:
        raise InputError(
            f"uncontrolled is {uncontrolled!r}; give {{name: samples}}, {{name: a distribution of scipy.stats}} or "
            "{(name, name): samples (N, 2)}."
        )
    found: Groups = {}
    for key, given in uncontrolled.items():
        names = (key,) if isinstance(key, str) else tuple(key)
        if hasattr(given, "ppf") and len(names) == 1:
            found[names] = given
            continue
        try:
            samples: NDArray[Any] = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            samples = np.empty(0)
        samples = samples[:, None] if samples.ndim == 1 else samples
        if samples.ndim != 2 or samples.shape[1] != len(names) or len(samples) < 2 or not np.isfinite(samples).all():
            raise InputError(
                f"uncontrolled {', '.join(names)} is {str(given)[:60]!r}; give two or more finite samples, (N,) or "
                f"(N, {len(names)}), or a distribution of scipy.stats such as scipy.stats.norm(1.0, 0.2)."
            )
        if np.any(np.ptp(samples, axis=0) == 0.0):
            raise InputError(f"all samples of {', '.join(names)} are equal; fix the variable instead, with fixed=.")
        found[names] = samples
    named = [name for names in found for name in names]
    if len(set(named)) < len(named):
        raise InputError(f"uncontrolled names a variable twice: {', '.join(named)}; give each once.")
    return found


def _independent(groups: Groups) -> dict[str, NDArray[np.float64]]:
    """Return joint samples of groups that do not depend on each other: a Sobol sequence of their quantiles."""
    from scipy.stats import qmc

    levels = qmc.Sobol(len(groups), scramble=False).random_base2(_JOINT) + 0.5 / 2**_JOINT
    columns: dict[str, NDArray[np.float64]] = {}
    for level, (names, given) in zip(levels.T, groups.items(), strict=True):
        if hasattr(given, "ppf"):
            columns[names[0]] = np.asarray(given.ppf(level), dtype=np.float64)
            continue
        ordered = given[np.lexsort(given.T[::-1])]
        rows = ordered[np.minimum((level * len(given)).astype(np.intp), len(given) - 1)]
        columns |= dict(zip(names, rows.T, strict=True))
    return columns
