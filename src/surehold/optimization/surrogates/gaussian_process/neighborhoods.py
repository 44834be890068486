"""Which trials an average over many points is answered from, where the nearest of one point do not reach far enough.

The points of an average are shared out among a few neighborhoods: the query's own, and those of trials that lie among
the points which it does not reach. The latter serve many queries; each is factorized when it is first needed.
"""

from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import FEWEST_NEIGHBORHOODS, MOST_NEIGHBORHOODS, WITHIN_REACH
from surehold.errors import SureholdError
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.posterior import Hyperparameters
from surehold.optimization.surrogates.gaussian_process.prediction import factorize
from surehold.store.kernels import njit

__all__ = ["Neighborhoods", "Shares", "gathered", "unfactorized"]

_MOST: Final = 2**24  # numbers of factors that are kept, 128 MiB


class Nearest(Protocol):
    """Finds the trials (q, k) near queries (q, d), how many each has (q,), and how far the nearest ones reach (q,)."""

    def __call__(
        self, queries: NDArray[np.float64], /
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]: ...


class Shares(NamedTuple):
    """The points of each query, shared out: of group 0 is what the query's own neighborhood answers."""

    groups: NDArray[np.int64]
    """of each point, (q, s)"""
    anchors: NDArray[np.int64]
    """whose neighborhoods are groups 1, 2, ..., (q, g - 1), filled up with -1"""


class Prepared(NamedTuple):
    """Neighborhoods of a anchors, and what is factorized of them."""

    rows: NDArray[np.int64]
    """their trials, (a, k)"""
    counts: NDArray[np.int64]
    """how many of a row there are, (a,)"""
    slots: NDArray[np.int64]
    """where the factors stand, -1 where there are none yet, (a,)"""
    inverse_L: NDArray[np.float64]
    """inverse factors, row by row, (slots, m, k k)"""
    alpha: NDArray[np.float64]
    """A^-1 y, (slots, m, k)"""


class Neighborhoods:
    """The neighborhoods of every so manieth trial, the anchors.

    Parameters
    ----------
    evidence, Y, hyperparameters
        Trials, the outputs (m, n) that each particle has seen, and the particles.
    anchors : (a,)
        Numbers of the trials whose neighborhoods these are.
    scale : (d,)
        What inputs are multiplied by before their distances are taken.
    nearest
        Finds the trials near queries.
    """

    def __init__(
        self,
        evidence: Evidence,
        Y: NDArray[np.float64],
        hyperparameters: Hyperparameters,
        anchors: NDArray[np.int64],
        scale: NDArray[np.float64],
        nearest: Nearest,
    ):
        from scipy.spatial import KDTree

        self._evidence, self._Y, self._own, self._scale = evidence, Y, hyperparameters, scale
        places = evidence.X[anchors]
        self._places: Final = places * scale
        self._tree: Final = KDTree(self._places)
        self._rows, self._counts, self._reach = nearest(places)
        m, width = len(Y), self._rows.shape[1]
        self._slots = np.full(len(anchors), -1, dtype=np.int64)
        self._inverse_L = np.empty((0, m, width * width))
        self._alpha = np.empty((0, m, width))
        self._used = 0

    def shares(self, queries: NDArray[np.float64], points: NDArray[np.float64], reach: NDArray[np.float64]) -> Shares:
        """Return how the points (q, s, d) of queries (q, d) are shared out; reach (q,) is that of each query's own."""
        q, s, d = points.shape
        scaled = np.ascontiguousarray(points * self._scale)
        nearest = np.asarray(self._tree.query(scaled.reshape(-1, d))[1], dtype=np.int64).reshape(q, s)
        most = min(max(FEWEST_NEIGHBORHOODS, s // 4), MOST_NEIGHBORHOODS)
        return Shares(*_shared(queries * self._scale, scaled, reach, nearest, self._places, self._reach, most))

    def prepared(self, anchors: NDArray[np.int64]) -> Prepared:
        """Return the neighborhoods of anchors, -1 being none, and factorize those that are not yet."""
        needed = np.unique(anchors[anchors >= 0])
        missing = needed[self._slots[needed] < 0]
        if (self._used + len(missing)) * len(self._Y) * self._inverse_L.shape[2] > _MOST:
            self._slots[:] = -1
            self._used, missing = 0, needed
        wanted = self._used + len(missing)
        if wanted > len(self._alpha):
            self._inverse_L = _longer(self._inverse_L, max(wanted, 2 * self._used), self._used)
            self._alpha = _longer(self._alpha, max(wanted, 2 * self._used), self._used)
        evidence, own = self._evidence, self._own
        done = _factorize_each(
            missing,
            self._rows,
            self._counts,
            evidence.X,
            self._Y,
            evidence.noise,
            own.inverse_l,
            own.s2,
            own.v,
            evidence.ratio,
            evidence.mean_variance,
            evidence.kernel,
            self._inverse_L[self._used : wanted],
            self._alpha[self._used : wanted],
        )
        if not done:
            raise unfactorized()
        self._slots[missing] = np.arange(self._used, wanted)
        self._used = wanted
        return Prepared(self._rows, self._counts, self._slots, self._inverse_L, self._alpha)


def unfactorized() -> SureholdError:
    """Return the error of trials whose covariance could not be factorized."""
    return SureholdError("the covariance of the trials could not be factorized; are outputs of sane size?")


def _longer(array: NDArray[np.float64], length: int, kept: int) -> NDArray[np.float64]:
    longer = np.empty((length, *array.shape[1:]))
    longer[:kept] = array[:kept]
    return longer


@njit(cache=True)
def _shared(queries, points, reach, nearest, places, reaches, most):
    """Return groups (q, s) and anchors (q, g - 1), farthest point first; all lengths are scaled.

    queries (q, d), their points (q, s, d) and the reach (q,) of their neighborhoods; nearest (q, s) is the anchor
    nearest to each point, places (a, d) and reaches (a,) are those of the anchors.
    """
    q, s, d = points.shape
    groups = np.zeros((q, s), dtype=np.int64)
    anchors = np.full((q, most), -1, dtype=np.int64)
    gaps = np.empty(s)
    for i in range(q):
        for w in range(s):
            squared = 0.0
            for c in range(d):
                squared += (points[i, w, c] - queries[i, c]) ** 2
            gaps[w] = np.sqrt(squared) / reach[i]
        found = 0
        while found < most:
            far = np.argmax(gaps)
            if not gaps[far] > WITHIN_REACH:
                break
            anchor = nearest[i, far]
            gaps[far] = 0.0  # nothing is nearer to it than what comes now
            known = False
            for g in range(found):
                if anchors[i, g] == anchor:
                    groups[i, far] = g + 1
                    known = True
            if known:
                continue
            anchors[i, found] = anchor
            found += 1
            groups[i, far] = found
            for w in range(s):
                squared = 0.0
                for c in range(d):
                    squared += (points[i, w, c] - places[anchor, c]) ** 2
                gap = np.sqrt(squared) / reaches[anchor]
                if gap < gaps[w]:
                    gaps[w] = gap
                    groups[i, w] = found
    return groups, anchors


@njit(cache=True)
def gathered(row, X, Y, noise):
    """Return inputs (k, d), outputs (m, k) and noise (k,) of the trials that row (k,) numbers."""
    k, m, d = row.size, Y.shape[0], X.shape[1]
    near = np.empty((k, d))
    values = np.empty((m, k))
    loud = np.empty(k)
    for a in range(k):
        loud[a] = noise[row[a]]
        for c in range(d):
            near[a, c] = X[row[a], c]
        for j in range(m):
            values[j, a] = Y[j, row[a]]
    return near, values, loud


@njit(cache=True)
def _factorize_each(
    missing, rows, counts, X, Y, noise, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_Ls, alphas
):
    """Fill inverse_Ls (a, m, k k) and alphas (a, m, k) for the rows that `missing` (a,) numbers; False on failure."""
    m = Y.shape[0]
    for i in range(missing.size):
        k = counts[missing[i]]
        near, values, loud = gathered(rows[missing[i], :k], X, Y, noise)
        inverse_L = np.empty((m, k, k))
        alpha = np.empty((m, k))
        if factorize(near, values, loud, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_L, alpha) < 0:
            return False
        for j in range(m):
            for a in range(k):
                alphas[i, j, a] = alpha[j, a]
                for b in range(k):
                    inverse_Ls[i, j, a * k + b] = inverse_L[j, a, b]
    return True
