import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from surehold.campaigns.statistics import bootstrap_interval, holm, p_against, paired, summary
from surehold.errors import InputError

X = np.random.default_rng(0).normal(3.0, 2.0, 40)
Y = X + np.random.default_rng(1).normal(0.4, 1.0, 40)


def test_summary_beside_scipy():
    told = summary(X)
    assert told.n == 40
    assert told.mean == pytest.approx(np.mean(X))
    assert told.se == pytest.approx(stats.sem(X))
    assert told.median == pytest.approx(np.median(X))
    assert told.std == pytest.approx(stats.tstd(X))


def test_bootstrap_interval_beside_scipy():
    other = stats.bootstrap((X,), np.mean, n_resamples=20000, method="percentile", rng=np.random.default_rng(5))
    assert bootstrap_interval(X) == pytest.approx(tuple(other.confidence_interval), abs=0.05)
    assert bootstrap_interval(X) == bootstrap_interval(X)


def test_bootstrap_interval_covers_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(3)
    intervals = [bootstrap_interval(rng.exponential(1.0, 60)) for _ in range(300)]
    covered = np.mean([low <= 1.0 <= high for low, high in intervals])
    assert 0.89 <= covered <= 0.98


def test_paired_beside_scipy():
    told = paired(Y, X)
    assert told.mean == pytest.approx(np.mean(Y - X))
    assert told.se == pytest.approx(stats.sem(Y - X))
    assert told.p == pytest.approx(stats.wilcoxon(Y, X).pvalue)
    ranks = stats.rankdata(np.abs(Y - X))
    up, down = ranks[Y > X].sum(), ranks[Y < X].sum()
    assert told.r == pytest.approx((up - down) / (up + down))


@pytest.mark.parametrize(
    "difference",
    [[1.0] * 4, [1.0] * 5, [1.0, 1.0, 1.0, -1.0, 1.0, 0.0], [2.0, -1.0, 1.0, 3.0, 3.0, -2.0], [0.5, 2.0, 1.0]],
)
def test_differences_of_the_same_size_are_judged_by_all_their_signs(difference):
    other = np.array([d for d in difference if d != 0.0])

    def positive(signed):
        return (stats.rankdata(np.abs(signed)) * (signed > 0.0)).sum()

    every = stats.permutation_test((other,), positive, permutation_type="samples", n_resamples=np.inf)
    assert paired(difference, np.zeros(len(difference))).p == pytest.approx(every.pvalue)


@pytest.mark.parametrize(("n", "digits"), [(6, 9), (20, 9), (50, 9), (51, 9), (60, 1)])
def test_p_values_of_few_and_of_many_differences_beside_scipy(n, digits):
    difference = np.random.default_rng(n).normal(0.3, 1.0, n).round(digits)
    difference[difference == 0.0] = 0.1
    expected = stats.wilcoxon(difference, method="exact" if n <= 50 else "asymptotic").pvalue
    assert paired(difference, np.zeros(n)).p == pytest.approx(expected, rel=1e-9)


def test_the_effect_size_has_its_limits_and_sign():
    assert paired(X + 1.0, X).r == 1.0
    assert paired(X - 1.0, X).r == -1.0
    same = paired(X, X)
    assert (same.p, same.r, same.mean) == (1.0, 0.0, 0.0)
    assert paired(X, Y).r == pytest.approx(-paired(Y, X).r)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_beside_its_definition(p):
    adjusted = holm(p)
    order = np.argsort(p, kind="stable")
    m = len(p)
    for rank, i in enumerate(order):
        expected = max(min(1.0, (m - j) * p[order[j]]) for j in range(rank + 1))
        assert adjusted[i] == pytest.approx(expected)
        assert adjusted[i] >= p[i]


def test_holm_beside_statsmodels():
    multitest = pytest.importorskip("statsmodels.stats.multitest", reason="statsmodels is not installed")
    p = np.random.default_rng(2).random(15) ** 3
    assert holm(list(p)) == pytest.approx(list(multitest.multipletests(p, method="holm")[1]))


def test_p_against_a_published_mean_is_welchs():
    other = stats.norm.ppf((np.arange(100) + 0.5) / 100, loc=2.5, scale=1.5)
    std = float(other.std(ddof=1))
    expected = stats.ttest_ind(X, other, equal_var=False).pvalue
    assert p_against(X, float(other.mean()), std, 100) == pytest.approx(expected)
    assert p_against(X, float(X.mean()), None, 100) == pytest.approx(1.0)
    assert np.isnan(p_against([1.0], 2.0, None, 100))
    assert np.isnan([p_against(X, 2.0, 1.5, 1), p_against([1.0, 1.0], 1.0, 0.0, 1)]).all(), "one run has no spread"
    assert p_against([1.0, 1.0], 1.0, 0.0, 100) == 1.0
    assert p_against([1.0, 1.0], 2.0, None, 100) == 0.0


@pytest.mark.parametrize("bad", [[], [1.0, np.nan], [np.inf]])
def test_bad_values_are_refused(bad):
    with pytest.raises(InputError):
        summary(bad)
    with pytest.raises(InputError, match="lengths"):
        paired([1.0, 2.0], [1.0])
