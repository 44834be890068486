"""Axis-parallel partition of the unit cube by a regression tree on the outputs: splits, leaves, routing.

Legend
    A             trials of a node, |A| = n; A' and A'' those of its children
    x_i > tau     test of an inner node: the upper child where it holds                               thesis (3.7)
    U(A)          mean (y - mean y)^2, the uncertainty of a node                                      thesis (3.8)
    gain          U(A) - |A'|/|A| U(A') - |A''|/|A| U(A'')                                            thesis (3.9)
A split lies at a trial, and the trials on it belong to both children, so that the two sides agree there; |A'| + |A''|
exceeds |A| by their number, and the gain of a useless split is negative.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.store.kernels import njit

__all__ = ["Node", "Partition", "Split", "grow", "split_gains"]


class Split(NamedTuple):
    """The test of an inner node."""

    dimension: int
    """i"""
    threshold: float
    """tau, in widths of the unit cube"""
    gain: float
    """decrease of the uncertainty, in squared outputs"""


@dataclass(frozen=True)
class Node:
    """A box of the tree and its trials."""

    lower: NDArray[np.float64]
    """(d,)"""
    upper: NDArray[np.float64]
    """(d,)"""
    members: NDArray[np.intp]
    """indices of its trials, ascending, (n,)"""
    depth: int
    """0 for the root"""
    parent: int
    """position of the parent in `Partition.nodes`, -1 for the root"""
    split: Split | None
    """None for a leaf"""
    children: tuple[int, int]
    """positions of the lower and the upper child, (-1, -1) for a leaf"""


@dataclass(frozen=True)
class Partition:
    """A tree, parents before children."""

    nodes: tuple[Node, ...]
    leaves: NDArray[np.intp]
    """positions of the leaves in `nodes`, (l,)"""
    lower: NDArray[np.float64]
    """lower corners of the leaves, (l, d)"""
    upper: NDArray[np.float64]
    """upper corners of the leaves, (l, d)"""
    table: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]
    """the tree for compiled code: dimension (-1 for a leaf), threshold, and (lower, upper) child or leaf number"""

    def route(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the number of the leaf (q,) that owns each point (q, d); points outside the cube have one, too."""
        return _route(np.ascontiguousarray(points), *self.table)

    @property
    def depth(self) -> int:
        """Splits above the deepest leaf."""
        return max(self.nodes[leaf].depth for leaf in self.leaves)

    def blocks(self, leaf: int) -> list[NDArray[np.intp]]:
        """Return the trials of a leaf, then of each ancestor those that are in no earlier block     thesis (3.10)."""
        node = self.nodes[self.leaves[leaf]]
        parts = [node.members]
        while node.parent >= 0:
            parent = self.nodes[node.parent]
            parts.append(np.setdiff1d(parent.members, node.members, assume_unique=True))
            node = parent
        return parts


@njit(cache=True)
def _gains(orders, X, y, weights, least, lower, upper, margin, gains):
    """Fill gains (d, n): that of a split at the k-th smallest coordinate, -inf where it is refused.

    orders (d, n) are the node's trials by ascending coordinate. Sums are weighted; `least` counts trials.
    """
    d, n = orders.shape
    total, mean = 0.0, 0.0
    for k in range(n):
        total += weights[orders[0, k]]
        mean += weights[orders[0, k]] * y[orders[0, k]]
    mean /= total
    below = np.empty((3, n + 1))  # sums of w, w (y - mean), w (y - mean)^2 over the first k trials
    below[:, 0] = 0.0
    for i in range(d):
        for k in range(n):
            w = weights[orders[i, k]]
            t = y[orders[i, k]] - mean
            below[0, k + 1] = below[0, k] + w
            below[1, k + 1] = below[1, k] + w * t
            below[2, k + 1] = below[2, k] + w * t * t
        start = 0
        while start < n:
            tau = X[orders[i, start], i]
            stop = start + 1
            while stop < n and X[orders[i, stop], i] == tau:
                stop += 1
            gain = -np.inf
            enough = stop >= least and n - start >= least and start > 0 and stop < n
            if enough and tau - lower[i] >= margin[i] and upper[i] - tau >= margin[i]:
                low = below[2, stop] - below[1, stop] ** 2 / below[0, stop]
                w = below[0, n] - below[0, start]
                s = below[1, n] - below[1, start]
                high = below[2, n] - below[2, start] - s * s / w
                whole = below[2, n] - below[1, n] ** 2 / below[0, n]
                gain = (whole - low - high) / total
            for k in range(start, stop):
                gains[i, k] = gain
            start = stop


@njit(cache=True)
def _route(points, dimension, threshold, children):
    out = np.empty(points.shape[0], dtype=np.int64)
    for q in range(points.shape[0]):
        node = 0
        while dimension[node] >= 0:
            node = children[node, 1 if points[q, dimension[node]] > threshold[node] else 0]
        out[q] = children[node, 0]
    return out


def split_gains(
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    min_leaf: int,
    *,
    margin: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the gain (d, n) of a split of the unit cube at every coordinate of the trials X (n, d), y (n,).

    -inf where a child would have fewer than `min_leaf` trials or the threshold is nearer to the border than `margin`
    (d,). Column k belongs to trial k.
    """
    n, d = X.shape
    orders = np.ascontiguousarray(np.argsort(X.T, axis=1, kind="stable"))
    gains = np.empty((d, n))
    edge = np.zeros(d) if margin is None else margin
    _gains(orders, X, y, np.ones(n), min_leaf, np.zeros(d), np.ones(d), edge, gains)
    by_trial = np.empty_like(gains)
    np.put_along_axis(by_trial, orders, gains, axis=1)
    return by_trial


def grow(
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    min_leaf: int,
    margin: NDArray[np.float64],
    weights: NDArray[np.float64] | None = None,
) -> Partition:
    """Split the unit cube greedily at the highest gain, while it is positive.

    Parameters
    ----------
    X, y
        Trials (n, d) in the unit cube and their outputs (n,).
    min_leaf
        Smallest number of trials in a leaf.
    margin : (d,)
        No threshold lies nearer to the border of its box than this.
    weights : (n,)
        Of the trials in the uncertainty; 1 by default.
    """
    n, d = X.shape
    shares = np.ones(n) if weights is None else weights
    pending = [(np.zeros(d), np.ones(d), np.argsort(X.T, axis=1, kind="stable"), 0, -1, 0)]
    nodes: list[Node] = []
    children: list[list[int]] = []
    while pending:
        lower, upper, orders, depth, parent, side = pending.pop()
        position = len(nodes)
        if parent >= 0:
            children[parent][side] = position
        split = _best_split(X, y, shares, orders, min_leaf, lower, upper, margin)
        nodes.append(Node(lower, upper, np.sort(orders[0]), depth, parent, split, (-1, -1)))
        children.append([-1, -1])
        if split is None:
            continue
        i, tau = split.dimension, split.threshold
        x = X[:, i]
        for side, keep in ((1, x >= tau), (0, x <= tau)):  # the lower child is looked at first
            child_lower, child_upper = lower.copy(), upper.copy()
            (child_lower if side else child_upper)[i] = tau
            inside = keep[orders]
            part = orders[inside].reshape(d, -1)  # every row holds the same trials
            pending.append((child_lower, child_upper, part, depth + 1, position, side))
    return _partition(nodes, children)


def _best_split(
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    weights: NDArray[np.float64],
    orders: NDArray[np.intp],
    min_leaf: int,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    margin: NDArray[np.float64],
) -> Split | None:
    d, n = orders.shape
    if n < min_leaf + 1:
        return None
    gains = np.empty((d, n))
    _gains(np.ascontiguousarray(orders), X, y, weights, min_leaf, lower, upper, margin, gains)
    i, k = divmod(int(np.argmax(gains)), n)
    gain = float(gains[i, k])
    return Split(i, float(X[orders[i, k], i]), gain) if gain > 0.0 else None


def _partition(nodes: list[Node], children: list[list[int]]) -> Partition:
    linked = tuple(
        Node(node.lower, node.upper, node.members, node.depth, node.parent, node.split, (pair[0], pair[1]))
        for node, pair in zip(nodes, children, strict=True)
    )
    leaves = np.array([k for k, node in enumerate(linked) if node.split is None])
    links = np.array(children, dtype=np.int64)
    links[leaves, 0] = np.arange(len(leaves))
    dimension = np.array([-1 if node.split is None else node.split.dimension for node in linked], dtype=np.int64)
    threshold = np.array([0.0 if node.split is None else node.split.threshold for node in linked])
    lower = np.array([linked[leaf].lower for leaf in leaves])
    upper = np.array([linked[leaf].upper for leaf in leaves])
    return Partition(linked, leaves, lower, upper, (dimension, threshold, links))
