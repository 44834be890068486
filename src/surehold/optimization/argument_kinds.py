"""Of what kind the arguments of an optimizer are, so that one of another kind is refused in one line."""

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk

__all__ = ["check_kinds"]


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _text_or_none(value: Any) -> bool:
    return value is None or isinstance(value, str)


def _flag(value: Any) -> bool:
    return isinstance(value, (bool, np.bool_))


def _number(value: Any) -> bool:
    if _flag(value) or not isinstance(value, (Real, np.number)):
        return False
    try:
        float(value)
    except (TypeError, OverflowError):  # complex, or an integer beyond the range of floats
        return False
    return True


def _pair(value: Any) -> bool:
    return value is None or (isinstance(value, (tuple, list)) and len(value) == 2 and all(map(_number, value)))


_TEXT: Final = (_text, "a name")
_NAME: Final = (_text_or_none, "a name, or None")
_FLAG: Final = (_flag, "True or False")
_NUMBER: Final = (_number, "a number")
_VALUES: Final = (lambda value: value is None or isinstance(value, Mapping), "{name: value}, or None")
_KINDS: Final[dict[str, tuple[Callable[[Any], bool], str]]] = {
    "direction": _TEXT,
    "design": _TEXT,
    "border": _TEXT,
    "outcome": _TEXT,
    "conditions": _TEXT,
    "criterion": _NAME,
    "quadrature": _NAME,
    "preset": _NAME,
    "failures": _NAME,
    "noise_while_exploring": _FLAG,
    "trust_region": _FLAG,
    "k": _NUMBER,
    "kappa": _NUMBER,
    "feasible": _NUMBER,
    "safety": (lambda value: value is None or _number(value), "a probability, or None"),
    "noise": (
        lambda value: _text_or_none(value) or _number(value),
        "the name of an observation noise, its standard deviation, or None",
    ),
    "risk": (lambda value: isinstance(value, (str, Risk)), "a name, or a surehold.Risk"),
    "surrogate": (
        lambda value: (
            _text_or_none(value) or (callable(getattr(value, "condition", None)) and not isinstance(value, type))
        ),
        "a name, an object such as surehold.GaussianProcess(), or None",
    ),
    "fixed": _VALUES,
    "guess": _VALUES,
    "output_range": (_pair, "(lowest, highest) value to expect, or None"),
}


def check_kinds(settings: Mapping[str, Any]) -> None:
    """Raise InputError for the first of the settings of `Optimizer` that is of another kind than it can be."""
    for name, (fits, wanted) in _KINDS.items():
        if name in settings and not fits(settings[name]):
            shown = " ".join(repr(settings[name]).split())
            raise InputError(f"{name} is {shown[:77] + '...' if len(shown) > 80 else shown}; give {wanted}.")
