"""What a robot tells of a trial that touched: points and outward normals, in the object's frame, and swept space.

    {"contacts": [{"point": [x, y, z], "normal": [nx, ny, nz]}, ...], "free": [[x, y, z, r], ...]}

in meters; `free` may be left out: within r of these points there was no object. What contradicts itself or what is
known is refused, with the numbers: a wrong frame, a wrong unit and inward normals are the usual reasons.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.shape.implicit_surface import ImplicitSurface, Observations

__all__ = ["TOUCH_NOISE", "checked_against", "contact_rows", "contacts_of_file", "contacts_told", "touches"]

Array = NDArray[np.float64]

TOUCH_NOISE: Final = 0.0005  #: of a felt point, along its normal [m]
NORMAL_NOISE: Final = 0.15  #: of a normal's components
_MOST: Final = 400  # contacts told at once
_SAME_PLACE: Final = 0.001  # nearer contacts are of one spot of the surface [m]
_LARGEST: Final = 2.0  # a coordinate [m]; what is larger was not told in meters
_IMPOSSIBLE: Final = 6.0  # standard deviations that a contact may lie off what is known
_CLOSE: Final = 0.008  # a contact nearer to the surface is never impossible [m]
_INSIDE: Final = _IMPOSSIBLE * TOUCH_NOISE  # a contact as far inside free space is impossible [m]
_CERTAIN: Final = 0.0015  # where the surface is known so well and is so near, normals are known: walls are thicker [m]
_FORM: Final = '{"contacts": [{"point": [x, y, z], "normal": [x, y, z]}]} in meters'


def touches(points: Array, normals: Array) -> Observations:
    """Return contacts at points (n, 3) with outward unit normals (n, 3) as observations of a shape."""
    n = len(points)
    noise, slope_noise = np.full(n, TOUCH_NOISE), np.full(n, NORMAL_NOISE)
    return Observations(points, np.zeros(n), noise, points, normals, slope_noise, np.empty((0, 4)))


def contacts_of_file(path: str | Path) -> Observations:
    """Read contacts from JSON, see above.

    Raises
    ------
    InputError
        If the file cannot be read, or `contacts_told` refuses what it holds.
    """
    return contacts_told(contact_rows(path), f"contacts {str(path)!r}")


def contact_rows(path: str | Path) -> Any:
    """Read what a file of contacts holds, unchecked; raises InputError if it cannot be read or is no JSON."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"contacts {str(path)!r} cannot be read: {error.strerror}; check the path.") from None
    except ValueError as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"contacts {str(path)!r} are not read ({reason}); give {_FORM}.") from None


def contacts_told(told: Any, what: str = "contacts") -> Observations:
    """Return what a robot told, as observations.

    Parameters
    ----------
    told
        Plain data, see above.
    what
        Name of it in messages.

    Raises
    ------
    InputError
        If there are no contacts, a key or number is missing, a number is not finite, a normal is not of unit length,
        or two contacts at one place have opposite normals.
    """
    if not isinstance(told, Mapping) or not isinstance(told.get("contacts"), Sequence):
        raise InputError(f"{what} hold no list 'contacts'; give {_FORM}.")
    points, normals = _contacts(told["contacts"], what)
    free = _free(told.get("free", []), what)
    if not 0 < len(points) <= _MOST and not (len(free) and len(free) <= _MOST):
        raise InputError(f"{what} hold {len(points)} touches; give 1 to {_MOST}.")
    length = np.linalg.norm(normals, axis=1)
    bad = ~(np.all(np.isfinite(points), axis=1) & (np.abs(length - 1.0) < 0.1))
    if np.any(bad):
        first = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"contact {first} of {what} is {points[first].tolist()} with normal {normals[first].tolist()}; "
            "give finite points and unit normals."
        )
    if not (np.all(np.isfinite(free)) and np.all(free[:, 3] > 0.0)):
        raise InputError(f"a free point of {what} is not finite or has a radius of 0 or less; give [x, y, z, r].")
    largest = float(np.abs(np.vstack([points, free[:, :3]])).max())
    if largest > _LARGEST:
        raise InputError(f"{what} reach {largest:g} m from the object's frame; give meters, in that frame.")
    normals = normals / np.where(length > 0.0, length, 1.0)[:, None]
    _agreeing(points, normals, what)
    found = touches(points, normals)
    return found + Observations(free=free)


def _contacts(rows: Sequence[Any], what: str) -> tuple[Array, Array]:
    """Return points and normals (n, 3) as they were told; a contact that lacks one of them is named by its number."""
    found: dict[str, list[Array]] = {"point": [], "normal": []}
    for k, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise InputError(f"contact {k} of {what} is {str(row)[:60]!r}, without point and normal; give {_FORM}.")
        for name, told in found.items():
            if name not in row:
                given = ", ".join(str(key)[:40] for key in row) or "nothing"
                raise InputError(f"contact {k} of {what} has no {name!r}, but {given}; give {_FORM}.")
            told.append(_numbers(row[name], 3, f"{name} of contact {k} of {what}"))
    return np.reshape(found["point"], (-1, 3)), np.reshape(found["normal"], (-1, 3))


def _free(rows: Any, what: str) -> Array:
    """Return free balls (b, 4) as they were told."""
    if not isinstance(rows, Sequence):
        raise InputError(f"'free' of {what} is {str(rows)[:60]!r}; give [[x, y, z, radius], ...] in meters.")
    return np.reshape([_numbers(row, 4, f"free ball {k} of {what}") for k, row in enumerate(rows)], (-1, 4))


def _numbers(values: Any, n: int, what: str) -> Array:
    try:
        numbers = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.empty(0)
    if numbers.shape != (n,):
        raise InputError(f"{what} is {str(values)[:60]}; give {n} numbers in meters.")
    return numbers


def _agreeing(points: Array, normals: Array, what: str) -> None:
    """Refuse contacts of one place with opposite normals."""
    from scipy.spatial import KDTree

    pairs = KDTree(points).query_pairs(_SAME_PLACE, output_type="ndarray") if len(points) else np.empty((0, 2), int)
    opposite = pairs[np.sum(normals[pairs[:, 0]] * normals[pairs[:, 1]], axis=1) < -0.2] if len(pairs) else pairs
    if len(opposite):
        i, j = (int(k) for k in opposite[0])
        angle = np.degrees(np.arccos(np.clip(normals[i] @ normals[j], -1.0, 1.0)))
        raise InputError(
            f"contacts {i} and {j} of {what} are {1e3 * np.linalg.norm(points[i] - points[j]):.1f} mm apart, but their "
            f"normals {angle:.0f} degrees; normals point out of the object: turn or drop the wrong one."
        )


def checked_against(
    surface: ImplicitSurface, told: Observations, what: str = "contacts", before: Sequence[Observations] = ()
) -> None:
    """Refuse contacts and free space that cannot be of the shape that is known; `before` was told of it earlier.

    Raises
    ------
    InputError
        If a contact lies farther off the surface than is possible, on it with a normal into the object, or in free
        space; or if free space holds a point that is known of the surface.
    """
    _outside_of_free(told, what, before)
    _free_of_known(surface, told.free, what)
    if not len(told.points):
        return
    off = np.abs(surface.value(told.points))
    known = np.hypot(surface.deviation(told.points), told.noise)
    outward = surface.gradient(told.points)
    along = np.sum(outward * told.slopes, axis=1) / np.maximum(np.linalg.norm(outward, axis=1), 1e-9)
    inward = np.flatnonzero((np.maximum(off, known) < _CERTAIN) & (along < -0.8))
    if len(inward):
        raise InputError(
            f"contact {inward[0]} of {what} lies on the known surface, but its normal points into the object; "
            "turn the normals: they point out of it."
        )
    wrong = np.flatnonzero((off > _CLOSE) & (off > _IMPOSSIBLE * known))
    if len(wrong):
        k = int(wrong[np.argmax(off[wrong] / known[wrong])])
        raise InputError(
            f"contact {k} of {what} is {1e3 * off[k]:.0f} mm off the surface, which is known there to "
            f"{1e3 * known[k]:.0f} mm; give meters in the object's frame, or drop that contact."
        )


def _outside_of_free(told: Observations, what: str, before: Sequence[Observations]) -> None:
    """Refuse contacts within balls that were told to be free, now or before."""
    for other in (told, *before):
        if not len(told.points) or not len(other.free):
            continue
        inside = _depths(told.points, other.free)
        k, ball = (int(i) for i in np.unravel_index(np.argmax(inside), inside.shape))
        if inside[k, ball] > _INSIDE:
            name = f"free ball {ball} of {what}" if other is told else "a free ball that was told before,"
            raise InputError(
                f"contact {k} of {what} is {1e3 * inside[k, ball]:.1f} mm inside {name} "
                f"{_in_words(other.free[ball])}; where a hand touches is no free space: drop one of them, or make the "
                "radius smaller."
            )


def _free_of_known(surface: ImplicitSurface, free: Array, what: str) -> None:
    """Refuse balls told to be free that hold a contact told before, or a point of the cloud."""
    known = surface.observations
    on_surface = known.values == 0.0  # others are bounds
    if not len(free) or not np.any(on_surface):
        return
    points = known.points[on_surface]
    inside = _depths(points, free)
    beyond = inside - np.maximum(_INSIDE, _IMPOSSIBLE * known.noise[on_surface])[:, None]
    k, ball = (int(i) for i in np.unravel_index(np.argmax(beyond), beyond.shape))
    if beyond[k, ball] > 0.0:
        raise InputError(
            f"free ball {ball} of {what}, {_in_words(free[ball])}, holds a known point of the surface, "
            f"{points[k].round(4).tolist()}, {1e3 * inside[k, ball]:.1f} mm inside; give meters in the object's frame, "
            "drop that ball, or make its radius smaller."
        )


def _depths(points: Array, balls: Array) -> Array:
    """Return how far points (n, 3) are inside balls (b, 4), (n, b) [m]; outside of them it is negative."""
    return balls[:, 3] - np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2)


def _in_words(ball: Array) -> str:
    return f"[{', '.join(f'{v:.4g}' for v in ball)}]"
