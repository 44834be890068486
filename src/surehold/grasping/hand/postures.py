"""Recorded postures of a hand: a CSV file with a column for each joint and a row for each posture.

    index_1,index_2,thumb_1,grasp
    0.42,0.61,0.80,power
    0.10,0.22,0.95,pinch

The order of the columns does not matter, and joints that do not move may be missing. A column `grasp` names the grasps.
Angles are in radians, or in degrees if it is said; shifts of sliding joints are in meters. Columns apart by semicolons
may have decimal commas.
"""

import csv
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.model import Hand
from surehold.grasping.plain_data import regular_bytes

__all__ = ["Postures", "read_postures"]

_LABEL: Final = "grasp"
_MOST_COLUMNS: Final = 200


class Postures(NamedTuple):
    """Postures of a hand."""

    joints: tuple[str, ...]  #: (j,)
    angles: NDArray[np.float64]  #: (n, j) rad or m
    grasps: tuple[str, ...]  #: (n,) names; empty without such a column


def read_postures(path: str | Path, degrees: bool = False, hand: Hand | None = None) -> Postures:
    """Read recorded postures of a hand, where that is known; `degrees` is of turning joints, shifts are in meters.

    Raises
    ------
    InputError
        If the file cannot be read, a joint is given twice or is none of the hand, a row is too short or too long, an
        entry is no finite number, or all angles in degrees are so small that they are radians; the message names row
        and column.
    """
    where = str(path)
    try:
        text = regular_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{where!r} is not a text file in UTF-8; give a CSV file.") from None
    separator = ";" if ";" in (text.splitlines() or [""])[0] else ","
    try:
        reader = csv.reader(text.splitlines(), delimiter=separator)
        lines = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise InputError(f"{where!r} is no CSV file: {error}.") from None
    names = [name.strip() for name in lines[0][1]] if lines else []
    joints = [name for name in names if name != _LABEL]
    if not joints or len(names) > _MOST_COLUMNS or len(set(names)) != len(names) or "" in names:
        raise InputError(f"{where!r}: its first row must name up to {_MOST_COLUMNS} joints, each once.")
    known = [] if hand is None else [name for name in hand.joint_names if name]
    for name in joints if known else ():
        if name not in known:
            unknown = unknown_name("joint", name[:40], known)
            raise InputError(
                f"{where!r}: column {name[:40]!r} is no joint of the hand; leave it out, or mend it: {unknown}"
            )
    angles, grasps = np.empty((len(lines) - 1, len(joints))), []
    for i, (line, row) in enumerate(lines[1:]):
        if len(row) != len(names):
            raise InputError(f"{where!r}, row {line} has {len(row)} entries; the first row names {len(names)}.")
        k = 0
        for name, entry in zip(names, row, strict=True):
            if name == _LABEL:
                grasps.append(entry.strip())
                continue
            try:
                angles[i, k] = float(entry.replace(",", ".") if separator == ";" else entry)
            except ValueError:
                angles[i, k] = np.nan
            if not np.isfinite(angles[i, k]):
                raise InputError(f"{where!r}, row {line}, {name}: {entry[:40]!r} is no finite number.")
            k += 1
    if degrees:
        sliding = [] if hand is None else np.array(hand.joint_names)[hand.slides.ravel()].tolist()
        turning = [k for k, name in enumerate(joints) if name not in sliding]
        largest = float(np.abs(angles[:, turning]).max(initial=0.0))
        if 0.0 < largest <= 2.0 * np.pi:  # a hand that closes turns farther than so many degrees
            raise InputError(
                f"{where!r}: its largest angle is {largest:.4g}, which is hardly a motion in degrees; leave --degrees "
                "(of read_postures degrees=True) out if it is in radians."
            )
        angles[:, turning] = np.radians(angles[:, turning])
    return Postures(tuple(joints), angles, tuple(grasps))
