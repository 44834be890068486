"""Which inputs may be commanded: linear constraints and functions of the user's own.

Legend: U points of the unit cube (q, d); the region is the part of the cube, or of its lattice, that is allowed.

Where input noise carries an execution across the region's border, the rule at the border of the box holds there, too
(`Perturbations`): "extend" lets it, "keep" gives it the commanded input, "clip" draws it back towards that one.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import REGION_KNOWN, REGION_POOL, REGION_SEARCH, REGION_SEARCH_CALLS
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.constraints.by_name import Rule, of_coordinates
from surehold.optimization.constraints.linear import ROUNDING, Linear
from surehold.optimization.lattice import Lattice

__all__ = ["Region", "checked_rules", "region_of"]

_SHRINKS: Final = 40  # halvings, on average, of a chord before a step is given up


def checked_rules(allowed: Any) -> tuple[Rule, ...]:
    """Return the rules of `Optimizer(allowed=)`: a `Linear`, its text, a function, or several of these.

    Raises InputError for anything else.
    """
    if allowed is None:
        return ()
    rules: list[Rule] = []
    for rule in allowed if isinstance(allowed, Sequence) and not isinstance(allowed, str) else [allowed]:
        if isinstance(rule, str):
            rules.append(Linear.parse(rule))
        elif isinstance(rule, Linear) or callable(rule):
            rules.append(rule)
        else:
            raise InputError(
                f"allowed is {rule!r}; give sh.Linear({{name: weight}}, upper=...), a text such as 'a + 2*b <= 3', a "
                "function that returns True or False, or a list of these."
            )
    return tuple(rules)


def region_of(
    box: Box, allowed: Any, lattice: Lattice | None, seed: int, first: NDArray[np.float64]
) -> "Region | None":
    """Return the region of `Optimizer(allowed=)`, None for all of the box; `first` (k, d) must lie in it.

    Raises InputError as `checked_rules` and `Region` do, and where one of the first points is not allowed.
    """
    rules = tuple(of_coordinates(box, rule) for rule in checked_rules(allowed))
    if not rules:
        return None
    region = Region(box, rules, lattice, seed, first)
    if not region.contains(first).all():
        bad = first[~region.contains(first)][0]
        raise InputError(f"initial_points hold {box.as_dict(box.from_unit(bad))}, which is not allowed.")
    return region


class Region:
    """The allowed inputs.

    Parameters
    ----------
    box, lattice
        The search space; points are tested where they would be tried.
    rules
        All must hold.
    seed
        Of the search for allowed inputs.
    known : (k, d)
        Points of the cube that may be allowed, such as those to be tried first: where the region is too small to be
        hit by chance, the search starts there.

    Raises
    ------
    InputError
        If nothing that is allowed is found, or a function raises or returns anything but True or False. Once the region
        is made, an input for which that happens is not allowed, and the first one is warned of: no trial is lost.
    """

    def __init__(
        self, box: Box, rules: tuple[Rule, ...], lattice: Lattice | None, seed: int, known: NDArray[np.float64]
    ):
        self._box: Final = box
        self._lattice: Final = lattice
        self._functions: Final = tuple(rule for rule in rules if not isinstance(rule, Linear))
        linear = [rule for rule in rules if isinstance(rule, Linear)]
        rows = np.array([rule.row(box.names) for rule in linear]).reshape(-1, box.dimension)
        lower = np.array([-np.inf if rule.lower is None else rule.lower for rule in linear])
        upper = np.array([np.inf if rule.upper is None else rule.upper for rule in linear])
        base = rows @ box.lower  # w'x = w'(lower + widths u)
        self._A: Final = rows * box.widths  # (c, d)
        slack = ROUNDING * (np.abs(rows) @ np.maximum(np.abs(box.lower), np.abs(box.upper)))
        self._low: Final = lower - base - slack
        self._high: Final = upper - base + slack
        self._texts: Final = tuple(str(rule) for rule in linear)
        self._made = self._reported = False
        self.points: Final = self._found(np.random.default_rng([seed, 6]), known)
        self.points.flags.writeable = False
        self._made = True

    def contains(self, U: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which points U (q, d) are allowed, (q,)."""
        snapped = U if self._lattice is None else self._lattice.snap(U)
        totals = snapped @ self._A.T  # (q, c)
        inside = np.all((totals >= self._low) & (totals <= self._high), axis=1)
        for function in self._functions:
            for i in np.flatnonzero(inside):
                inside[i] = self._answer(function, self._box.from_unit(snapped[i]))
        return inside

    def draw(self, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n random allowed points (n, d): walks by hit and run from points that are known to be allowed.

        Smith 1984; the chord is shortened towards the walker after each miss (Neal 2003), so that the border need not
        be known.
        """
        at = self.points[rng.integers(len(self.points), size=n)].copy()
        for _ in range(2 * self._box.dimension):
            at = self._step(at, rng)
        return at

    def design(self, wanted: NDArray[np.float64], before: NDArray[np.float64], rng: Any) -> NDArray[np.float64]:
        """Return as many allowed points as `wanted` (n, d): those of them that are, then ones far from all others.

        `before` (k, d) are points that will be tried, too.
        """
        kept = self.contains(wanted)
        pool = np.concatenate([self.points, self.draw(REGION_POOL, rng)])
        taken = np.concatenate([before, wanted[kept]])
        distance = np.full(len(pool), np.inf)
        for point in taken:
            distance = np.minimum(distance, np.linalg.norm(pool - point, axis=1))
        result = wanted.copy()
        for i in np.flatnonzero(~kept):
            best = int(np.argmax(distance))
            result[i] = pool[best]
            distance = np.minimum(distance, np.linalg.norm(pool - pool[best], axis=1))
        return result

    # --- inside -------------------------------------------------------------------------------------------------

    def _answer(self, function: Callable[[NDArray[np.float64]], Any], x: NDArray[np.float64]) -> bool:
        try:
            answer = function(x)
        except Exception as error:  # whatever a user's function raises
            return self._without(f"raised {type(error).__name__} at x = {self._box.as_dict(x)}: {error}")
        if isinstance(answer, (bool, np.bool_)) or (isinstance(answer, np.ndarray) and answer.shape == ()):
            return bool(answer)
        return self._without(f"returned {answer!r} at x = {self._box.as_dict(x)}")

    def _without(self, what: str) -> bool:
        """Return False for an input of which a function says nothing; raises InputError while the region is made."""
        if not self._made:
            raise InputError(f"allowed {what}. Give a function that returns True or False for every x in the box.")
        if not self._reported:
            self._reported = True
            warnings.warn(f"allowed {what}. Inputs for which it does so are not allowed.", stacklevel=2)
        return False

    def _step(self, at: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Move every walker (n, d) once."""
        n, d = at.shape
        direction = rng.standard_normal((n, d))
        with np.errstate(divide="ignore"):
            ends = np.stack([-at / direction, (1.0 - at) / direction])  # (2, n, d)
        back, ahead = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        moved = at.copy()
        waiting = np.arange(n)
        for _ in range(_SHRINKS):
            t = back[waiting] + (ahead - back)[waiting] * rng.random(len(waiting))
            trial = np.clip(at[waiting] + t[:, None] * direction[waiting], 0.0, 1.0)
            good = self.contains(trial)
            moved[waiting[good]] = trial[good]
            back[waiting] = np.where(t < 0.0, t, back[waiting])
            ahead[waiting] = np.where(t >= 0.0, t, ahead[waiting])
            waiting = waiting[~good]
            if not len(waiting):
                break
        return moved

    def _found(self, rng: np.random.Generator, known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return allowed points (k, d), of the known ones and of a Sobol sequence."""
        from scipy.stats import qmc

        d = self._box.dimension
        found = [known[self.contains(known)]] if len(known) else []
        inside = self._inside_linear(rng)
        if len(inside):
            found.append(inside[self.contains(inside)])
        sequence = qmc.Sobol(d, rng=rng)
        tested, most = 0, REGION_SEARCH_CALLS if self._functions else REGION_SEARCH
        while tested < most and sum(map(len, found)) < REGION_KNOWN:
            points = sequence.random(1024)
            found.append(points[self.contains(points)])
            tested += 1024
        points = np.concatenate(found) if found else np.empty((0, d))
        if not len(points):
            points = self._from_linear(inside, rng)
        if not len(points):
            raise InputError(
                f"no allowed input was found among {tested:,} points of {self._box}{self._rules()}; if there is one, "
                "give it as initial_points=, or narrow the box around it."
            )
        return points[:REGION_KNOWN]

    def _inside_linear(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points (k, d) within the linear constraints and the cube, the center of their largest ball first.

        The others are random means of their farthest points in some directions, so that walks begin everywhere even in
        a strip. (0, d) without linear constraints; raises InputError where they contradict each other.
        """
        from scipy.optimize import linprog

        c, d = self._A.shape
        if c == 0:
            return np.empty((0, d))
        A, b = np.concatenate([self._A, -self._A]), np.concatenate([self._high, -self._low])
        A, b = A[np.isfinite(b)], b[np.isfinite(b)]
        walls = np.concatenate([np.eye(d), -np.eye(d)])
        ball = np.hstack([np.concatenate([A, walls]), np.ones((len(A) + 2 * d, 1))])
        ball[: len(A), -1] = np.linalg.norm(A, axis=1)
        room = np.concatenate([b, np.ones(d), np.zeros(d)])
        bounds: list[tuple[float, float | None]] = [(0.0, 1.0)] * d
        solved = linprog(np.append(np.zeros(d), -1.0), ball, room, bounds=[*bounds, (0.0, None)])
        if solved.x is None:
            raise InputError(
                f"no input of {self._box} is allowed{self._rules()}: the linear constraints contradict it."
            )
        center = solved.x[:d]
        directions = np.concatenate([walls, rng.standard_normal((2 * d, d))])
        ends = np.array([linprog(direction, A, b, bounds=bounds).x for direction in directions])
        means = rng.dirichlet(np.full(len(ends), 0.3), 64) @ ends
        return np.concatenate([center[None], 0.5 * (means + center), means])

    def _from_linear(self, inside: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return allowed points met on walks within the linear constraints, where the functions refused all others."""
        if not len(inside) or not self._functions:
            return np.empty((0, self._box.dimension))
        walkers = inside
        linear = object.__new__(Region)
        vars(linear).update(vars(self) | {"_functions": ()})
        found = []
        for _ in range(REGION_SEARCH_CALLS // (4 * len(inside))):
            walkers = linear._step(walkers, rng)
            found.append(walkers[self.contains(walkers)])
        return np.concatenate(found)

    def _rules(self) -> str:
        rules = [*self._texts, *(getattr(f, "__name__", "a function") for f in self._functions)]
        return f" by {', '.join(rules)}"
