"""Synergies from recorded postures: the directions in which the joints of a hand move together.

    q    joint angles or shifts, (j,), rad or m          m    their mean over the recorded postures
    v_k  component k, a unit vector, (j,)                a_k  its amplitude, (q - m) . v_k

Components are the principal ones: right singular vectors of the centered postures, the one that explains most of the
variance first (eigengrasps, Ciocarlie and Allen 2009). The hand closes along the first one, from the amplitude of the
open hand to that of the closed one, and the amplitudes of the others are variables of the search: s1 of the second, s2
of the third, and so on. With one component, or two, that is the synergy of the thesis: closure and posture.

Open and closed. Recorded postures are rarely those of a hand that is wide open or quite closed: the closing amplitude
goes beyond the recorded range by its width at both ends, but no farther than to where every joint is at its limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.model import CLOSED, Hand, Preshape
from surehold.grasping.plain_data import plain_yaml

__all__ = ["Synergy", "learn_synergy", "read_synergy", "with_synergy", "write_synergy"]

Array = NDArray[np.float64]

_FORMAT, _VERSION = "surehold_synergy", 1
MOST: Final = 4  #: components: the closing one, and s1 to s3
_TRIES: Final = 4  # values of s1 that the search of default poses tries
_FAR_SHIFT: Final = 1.0  # a sliding joint is never so far beyond its range [m]: no hand is so large
_SMALL: Final = 0.05  # a joint of a smaller share of the closing component does not decide where the hand is open


@dataclass(frozen=True, eq=False)
class Synergy:
    """Principal components of recorded postures."""

    joints: tuple[str, ...]  #: (j,) names
    mean: Array = field(repr=False)  #: (j,) m [rad or m]
    components: Array = field(repr=False)  #: (k, j) v, rows of length 1
    deviations: Array  #: (k,) standard deviations of the amplitudes [rad or m]
    explained: Array  #: (k,) shares of the variance
    ranges: Array = field(repr=False)  #: (k, 2) least and largest recorded amplitude
    closing: tuple[float, float]  #: amplitude of the first component of the open and of the closed hand
    hand: str = ""  #: name of the hand


def learn_synergy(joints: Sequence[str], angles: Array, hand: Hand, components: int = 2) -> Synergy:
    """Return the principal components of postures (n, j) of a hand.

    The first component points to where the hand's first preshape closes; of each other, its largest entry is positive.

    Raises
    ------
    InputError
        If a joint is none of the hand, given twice, or cannot be where it is said to be, a number is missing or not
        finite, there are too few postures for so many components, or all are equal.
    """
    x = np.asarray(angles, dtype=np.float64)
    if x.shape[1:] != (len(joints),) or not np.all(np.isfinite(x)) or len(set(joints)) != len(joints):
        raise InputError(
            f"postures of shape {x.shape} for {len(set(joints))} different joints; give one finite number for each, "
            "(postures, joints), and each joint once."
        )
    places = _places(hand, joints)
    _check_units(x, hand, joints, places)
    most = min(MOST, len(joints), len(x) - 1)
    if isinstance(components, bool) or not isinstance(components, int) or not 1 <= components <= max(most, 1):
        raise InputError(
            f"components are {components!r}; {len(x)} postures of {len(joints)} joints give 1 to {max(most, 1)}."
        )
    if len(x) < components + 1 or np.ptp(x, axis=0).max() < 1e-9:
        raise InputError(f"the {len(x)} postures do not differ; record a hand that moves.")
    mean = x.mean(axis=0)
    _, singular, rows = np.linalg.svd(x - mean, full_matrices=False)
    variances = singular**2 / (len(x) - 1)
    vectors = rows[:components].copy()
    closes = vectors[0] @ next(iter(hand.preshapes.values())).rate.ravel()[places]
    vectors[0] *= -1.0 if closes < 0.0 else 1.0
    for vector in vectors[1:]:
        vector *= np.sign(vector[np.argmax(np.abs(vector))])
    amplitudes = (x - mean) @ vectors.T
    ranges = np.column_stack([amplitudes.min(axis=0), amplitudes.max(axis=0)])
    return Synergy(
        tuple(joints),
        mean,
        vectors,
        np.sqrt(variances[:components]),
        variances[:components] / variances.sum(),
        ranges,
        _closing(vectors[0], mean, ranges[0], hand.lower.ravel()[places], hand.upper.ravel()[places]),
        hand.name,
    )


def with_synergy(hand: Hand, synergy: Synergy, name: str) -> Hand:
    """Return the hand with one more preshape, of that name, that closes along a synergy.

    Raises
    ------
    InputError
        If a joint of the synergy is none of the hand.
    """
    places = _places(hand, synergy.joints)

    def spread(values: Array, others: Array | None = None) -> Array:
        q = np.zeros(hand.lower.size) if others is None else others.ravel().copy()
        q[places] = values
        return q.reshape(hand.lower.shape)

    opened, closed = synergy.closing
    first, *others = synergy.components
    ranges = [(float(low), float(high)) for low, high in synergy.ranges[1:]]
    useful = ranges[0] if others else (0.0, 0.0)
    preshape = Preshape(
        start=spread(synergy.mean + opened * first, np.clip(0.0, hand.lower, hand.upper)),
        rate=spread((closed - opened) / CLOSED * first),
        posture=spread(others[0]) if others else np.zeros_like(hand.lower),
        s1_useful=useful,
        s1_range=useful,
        s1_tries=tuple(np.linspace(*useful, _TRIES + 2)[1:-1].tolist()) if others else (0.0,),
        further=tuple(spread(vector) for vector in others[1:]),
        further_ranges=tuple(ranges[1:]),
    )
    return replace(hand, preshapes={**hand.preshapes, name: preshape})


def write_synergy(path: str | Path, synergy: Synergy) -> None:
    """Write a synergy as YAML, numbers in full precision; InputError if the file cannot be written."""
    from surehold.store.atomic import write_file

    content = {
        "format": _FORMAT,
        "format_version": _VERSION,
        "hand": synergy.hand,
        "joints": list(synergy.joints),
        "mean": synergy.mean.tolist(),
        "components": synergy.components.tolist(),
        "deviations": synergy.deviations.tolist(),
        "explained": synergy.explained.tolist(),
        "ranges": synergy.ranges.tolist(),
        "closing": {"open": float(synergy.closing[0]), "closed": float(synergy.closing[1])},
    }
    write_file(Path(path), yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=1000))


def read_synergy(path: str | Path) -> Synergy:
    """Read a synergy; InputError, naming the entry, if the file cannot be read, is none, or of a newer version."""
    where, content = str(path), plain_yaml(path)
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise InputError(f"{where!r} is no synergy; make one with: surehold hand synergy POSTURES.csv.")
    if content.get("format_version") != _VERSION:
        raise InputError(
            f"{where!r} has format_version {str(content.get('format_version'))[:20]!r}; {_VERSION} is read."
        )
    joints = content.get("joints")
    if not isinstance(joints, list) or not joints or len(set(map(str, joints))) != len(joints):
        raise InputError(f"{where!r}: joints must be a list of names, each once.")
    components = _numbers(content.get("components"), (-1, len(joints)), f"{where!r}: components")
    k = len(components)
    if not 1 <= k <= MOST or np.any(np.abs(np.linalg.norm(components, axis=1) - 1.0) > 1e-6):
        raise InputError(f"{where!r}: components must be 1 to {MOST} rows of length 1.")
    closing = content.get("closing")
    ends = [closing.get(end) if isinstance(closing, dict) else None for end in ("open", "closed")]
    opened, closed = _numbers(ends, (2,), f"{where!r}: closing.open and closing.closed").tolist()
    if not opened < closed:
        raise InputError(f"{where!r}: closing.open is {opened:g}; it must be below closing.closed, {closed:g}.")
    ranges = _numbers(content.get("ranges"), (k, 2), f"{where!r}: ranges")
    if np.any(ranges[:, 0] >= ranges[:, 1]):
        raise InputError(f"{where!r}: each of the ranges must be two numbers, the smaller one first.")
    return Synergy(
        tuple(map(str, joints)),
        _numbers(content.get("mean"), (len(joints),), f"{where!r}: mean"),
        components,
        _numbers(content.get("deviations"), (k,), f"{where!r}: deviations"),
        _numbers(content.get("explained"), (k,), f"{where!r}: explained"),
        ranges,
        (opened, closed),
        str(content.get("hand", "")),
    )


def _places(hand: Hand, joints: Sequence[str]) -> list[int]:
    """Return where joints are among those of the hand (f j,), row by row."""
    known = [name for name in hand.joint_names if name]
    for name in joints:
        if name not in known:
            raise unknown_name(f"joint of hand '{hand.name}'", name, known)
    return [hand.joint_names.index(name) for name in joints]


def _check_units(x: Array, hand: Hand, joints: Sequence[str], places: Sequence[int]) -> None:
    """Refuse postures (n, j) that are in another unit: they would give a synergy that looks like one and is none."""
    slides = hand.slides.ravel()[places]
    lower, upper = hand.lower.ravel()[places], hand.upper.ravel()[places]
    least = np.where(slides, lower - _FAR_SHIFT, np.minimum(lower, -2.0 * np.pi))
    most = np.where(slides, upper + _FAR_SHIFT, np.maximum(upper, 2.0 * np.pi))
    beyond = np.maximum(least - x, x - most)
    if not len(x) or not beyond.max() > 0.0:
        return
    row, k = (int(i) for i in np.unravel_index(np.argmax(beyond), beyond.shape))
    unit = "m" if slides[k] else "rad"
    advice = "give meters" if slides[k] else "give radians, or say --degrees (of read_postures degrees=True)"
    raise InputError(
        f"joint {joints[k]!r} is {x[row, k]:.4g} {unit} in posture {row}, but of hand {hand.name!r} it goes from "
        f"{lower[k]:.3g} to {upper[k]:.3g} {unit}; {advice}."
    )


def _closing(vector: Array, mean: Array, recorded: Array, lower: Array, upper: Array) -> tuple[float, float]:
    """Return the amplitudes of the open and of the closed hand, as the module says."""
    width = float(recorded[1] - recorded[0])
    moves = np.abs(vector) >= _SMALL * np.abs(vector).max()
    v, m = vector[moves], mean[moves]
    ends = np.sort(np.stack([(lower[moves] - m) / v, (upper[moves] - m) / v]), axis=0)
    opened = max(float(recorded[0]) - width, min(float(ends[0].min()), float(recorded[0])))
    closed = min(float(recorded[1]) + width, max(float(ends[1].max()), float(recorded[1])))
    return opened, closed


def _numbers(values: Any, shape: tuple[int, ...], place: str) -> Array:
    wanted = " x ".join("k" if n < 0 else str(n) for n in shape)
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{place} must be {wanted} numbers.") from None
    if array.ndim != len(shape) or any(n not in (-1, m) for n, m in zip(shape, array.shape, strict=True)):
        raise InputError(f"{place} must be {wanted} numbers, not {' x '.join(map(str, array.shape))}.")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{place} must be finite.")
    return array
