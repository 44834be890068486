"""Values, places and changes as people write them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from surehold.reports.run_report import Candidate, RunReport, Variable

__all__ = ["change", "coordinate", "coordinates", "halved", "number", "percent", "setting", "worth"]


def number(value: float | None, digits: int = 3) -> str:
    """Return a value as people write it: `digits` significant digits, no exponent between 0.0001 and 100,000.

    Nor beyond, where so many digits reach behind the point. Infinity stands for "no value", NaN for nothing known.
    """
    if value is not None and math.isinf(value):
        return "no value"
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size < -4 or size >= max(5, digits):
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}".replace("-", "−")
    return f"{value:.{max(digits - 1 - size, 0)}f}".replace("-", "−")


def worth(report: RunReport, value: float | None, digits: int = 3) -> str:
    """Return a value of the run as people write it, with as many digits as tell the run's values apart."""
    return number(value, digits + report.more_digits)


def coordinate(variable: Variable, value: float, digits: int = 3) -> str:
    """Return a value of a variable as people write it, without its unit."""
    plain = float(variable.shown(np.float64(value)))  # type: ignore[arg-type]
    if variable.whole and abs(plain - round(plain)) < 1e-6 * max(abs(plain), 1.0) < 1e9:
        return f"{round(plain)}".replace("-", "−")
    return number(plain, digits + variable.more_digits)


def coordinates(report: RunReport, candidate: Candidate) -> str:
    """Return where a candidate is, as `dx = 3.1 mm, rx = 12°`."""
    parts = []
    for variable, value in zip(report.variables, candidate.x, strict=True):
        unit = variable.shown_unit
        space = "" if unit in ("", "°") else " "
        parts.append(f"{variable.name} = {coordinate(variable, value)}{space}{unit}{' (drawn)' * variable.drawn}")
    if candidate.trial is not None:
        parts += [f"{name} = {texts[candidate.trial]}" for name, texts in report.choices.items()]
    return ", ".join(parts)


def percent(share: float | None) -> str:
    """Return a share in percent."""
    return "–" if share is None or not math.isfinite(share) else f"{100.0 * share:.3g} %"


def halved(candidate: Candidate) -> int:
    """Return in how many re-queries the point lost more than half of its exact value; 0 where that says nothing.

    Where values are minimized a lower one is no loss.
    """
    if candidate.minimized or not candidate.quality > 0.0:
        return 0
    return int(np.sum(candidate.values < 0.5 * candidate.quality))


def change(candidate: Candidate) -> str:
    """Return by how many percent the re-queries' mean differs from the exact value; empty where that says nothing."""
    if not candidate.quality > 0.0 or not math.isfinite(candidate.mean):
        return ""
    share = 100.0 * (candidate.mean / candidate.quality - 1.0)
    return "unchanged" if abs(share) < 0.5 else f"{share:+.0f}\u00a0%".replace("-", "−")


def setting(value: Any) -> str:
    """Return a setting as people write it: limits and points as the command line takes them."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(_limit(name, v) if _is_limit(v) else f"{name}={setting(v)}" for name, v in value.items())
    if isinstance(value, list):
        return "; ".join(map(setting, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _is_limit(value: Any) -> bool:
    """Tell whether a value is [lower, upper] of an output, as studies store it."""
    return isinstance(value, list) and len(value) == 2 and all(v is None or isinstance(v, int | float) for v in value)


def _limit(name: str, pair: list[Any]) -> str:
    """Return the limits of an output, [lower, upper], in one line."""
    lower, upper = (None if number is None else f"{number:g}" for number in pair)
    return (f"{lower}<=" if lower else "") + name + (f"<={upper}" if upper else "")
