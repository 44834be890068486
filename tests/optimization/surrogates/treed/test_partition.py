import numpy as np
import pytest
from sklearn.tree import DecisionTreeRegressor

from surehold.optimization.surrogates.treed.partition import grow, split_gains

NO_MARGIN = np.zeros(2)


def data(seed, n=40, d=2, rounded=False):
    rng = np.random.default_rng(seed)
    X = rng.random((n, d))
    return (np.round(X, 1) if rounded else X), rng.standard_normal(n) + 5.0


def impurity_decrease(x, y, tau):
    """Let scikit-learn split, with the trials on the threshold in both children."""
    low, high = y[x <= tau], y[x >= tau]
    side = np.repeat([0.0, 1.0], [len(low), len(high)])[:, None]
    stump = DecisionTreeRegressor(max_depth=1).fit(side, np.concatenate([low, high])).tree_
    whole = DecisionTreeRegressor(max_depth=1).fit(x[:, None], y).tree_.impurity[0]
    return whole - (len(low) * stump.impurity[1] + len(high) * stump.impurity[2]) / len(y)


@pytest.mark.parametrize("rounded", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_gain_is_scikit_learns_impurity_decrease(seed, rounded):
    X, y = data(seed, rounded=rounded)
    gains = split_gains(X, y, 3)
    for i in range(2):
        for k in range(len(y)):
            tau = X[k, i]
            small = min(np.sum(X[:, i] <= tau), np.sum(X[:, i] >= tau)) < 3
            edge = tau in (X[:, i].min(), X[:, i].max())
            expected = -np.inf if small or edge else impurity_decrease(X[:, i], y, tau)
            assert gains[i, k] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_weights_count_trials_so_many_times(seed):
    """The uncertainty of a node with weights is scikit-learn's of samples with them."""
    X, y = data(seed)
    weights = np.random.default_rng(seed + 10).exponential(size=40)

    def uncertainty(own):
        tree = DecisionTreeRegressor(max_depth=1).fit(X[own], y[own], sample_weight=weights[own]).tree_
        return weights[own].sum() * tree.impurity[0]

    best, place = -np.inf, None
    for i in range(2):
        for tau in X[:, i]:
            low, high = X[:, i] <= tau, X[:, i] >= tau
            if min(low.sum(), high.sum()) >= 5 and not (low.all() or high.all()):
                gain = (uncertainty(low | high) - uncertainty(low) - uncertainty(high)) / weights.sum()
                best, place = max((best, place), (gain, (i, tau)))
    split = grow(X, y, 5, NO_MARGIN, weights).nodes[0].split
    assert (split.dimension, split.threshold) == place
    assert split.gain == pytest.approx(best, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_without_shared_trials_the_best_cut_is_scikit_learns(seed):
    # Each trial appears twice at almost the same place with the same output: what is shared weighs next to nothing.
    rng = np.random.default_rng(seed)
    X = np.repeat(rng.random((60, 2)), 200, axis=0) + 1e-9 * rng.random((12000, 2))
    y = np.repeat(rng.standard_normal(60), 200)
    tree = DecisionTreeRegressor(max_depth=1, min_samples_leaf=2000).fit(X, y).tree_
    split = grow(X, y, 2000, NO_MARGIN).nodes[0].split
    decrease = tree.impurity[0] - np.dot(tree.n_node_samples[1:], tree.impurity[1:]) / tree.n_node_samples[0]
    assert split.dimension == tree.feature[0]
    assert split.gain == pytest.approx(decrease, abs=2e-3)
    low = np.count_nonzero(X[:, split.dimension] <= split.threshold)
    assert abs(low - tree.n_node_samples[1]) <= 1


@pytest.mark.parametrize("min_leaf", [2, 5, 17])
def test_leaves_hold_enough_trials_and_cover_the_cube(min_leaf):
    X, y = data(5, 200, 3)
    partition = grow(X, y, min_leaf, np.full(3, 0.01))
    assert len(partition.leaves) > 1
    assert np.prod(partition.upper - partition.lower, axis=1).sum() == pytest.approx(1.0)
    for leaf, lower, upper in zip(partition.leaves, partition.lower, partition.upper, strict=True):
        members = partition.nodes[leaf].members
        assert len(members) >= min_leaf
        inside = np.all((lower <= X) & (upper >= X), axis=1)  # trials on a border belong to both sides
        assert np.array_equal(np.flatnonzero(inside), members)


def test_routing_follows_the_boxes():
    X, y = data(6, 300)
    partition = grow(X, y, 8, np.full(2, 0.01))
    queries = np.random.default_rng(0).random((500, 2))
    home = partition.route(queries)
    assert np.all(queries > partition.lower[home])
    assert np.all(queries <= partition.upper[home])
    outside = np.array([[-0.2, 0.5], [0.5, 1.3]])
    assert np.array_equal(partition.route(outside), partition.route(np.clip(outside, 0.0, 1.0)))


def test_a_query_on_the_threshold_belongs_to_the_lower_child():
    X = np.linspace(0.0, 1.0, 21)[:, None]
    partition = grow(X, (X[:, 0] > 0.5).astype(float), 5, np.zeros(1))
    tau = partition.nodes[0].split.threshold
    home = partition.route(np.array([[tau], [np.nextafter(tau, 1.0)]]))
    assert partition.upper[home[0], 0] == tau
    assert partition.lower[home[1], 0] == tau


def test_no_split_near_a_border():
    X, y = data(7, 400)
    margin = np.array([0.2, 0.05])
    partition = grow(X, y, 2, margin)
    assert len(partition.leaves) > 4
    assert np.all(partition.upper - partition.lower >= margin)


def test_no_split_without_gain():
    X, _ = data(8)
    assert len(grow(X, np.ones(len(X)), 2, NO_MARGIN).leaves) == 1
    assert len(grow(X[:1], np.ones(1), 2, NO_MARGIN).leaves) == 1
    assert len(grow(np.full((9, 2), 0.3), np.arange(9.0), 2, NO_MARGIN).leaves) == 1


def test_blocks_are_the_ancestors_trials_once_each():
    X, y = data(9, 120)
    partition = grow(X, y, 10, NO_MARGIN)
    for j, leaf in enumerate(partition.leaves):
        blocks = partition.blocks(j)
        assert len(blocks) == partition.nodes[leaf].depth + 1
        assert np.array_equal(blocks[0], partition.nodes[leaf].members)
        assert np.array_equal(np.sort(np.concatenate(blocks)), np.arange(120))


def test_the_same_trials_give_the_same_tree():
    X, y = data(10, 150)
    one, two = (grow(X, y, 6, NO_MARGIN) for _ in range(2))
    assert np.array_equal(one.lower, two.lower)
    order = np.random.default_rng(0).permutation(150)
    shuffled = grow(X[order], y[order], 6, NO_MARGIN)
    assert np.array_equal(one.lower, shuffled.lower)
