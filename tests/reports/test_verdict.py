import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.reports.run_report import Candidate, RunReport, Variable
from surehold.reports.verdict import verdict
from surehold.reports.wording import change, coordinates, number


def report(*candidates, **changes):
    fields = {
        "title": "t",
        "variables": (Variable("dx", -0.05, 0.05, "m"), Variable("rx", -1.0, 1.0, "rad"), Variable("s", 0.0, 1.0)),
        "X": np.zeros((4, 3)),
        "y": np.array([1.0, 2.0, 3.0, np.nan]),
        "n_initial": 2,
        "best_trace": np.array([1.0, 2.0, 3.0, 3.0]),
        "candidates": candidates,
        "settings": {},
        "seed": 0,
    }
    return RunReport(**(fields | changes))


def shaken(label, quality, values, trial=1):
    return Candidate(label, np.array([0.0031, 0.5, 0.25]), quality, trial, np.asarray(values, dtype=float))


SPREAD = np.linspace(-1.0, 1.0, 50)


def test_the_peak_is_refused_with_its_numbers():
    told = verdict(
        report(shaken("highest observed", 3.0, 1.0 + SPREAD), shaken("recommended", 2.0, 1.9 + 0.05 * SPREAD))
    )
    assert told.refused
    assert "refused" in told.headline
    for part in ("3.00", "1.00", "1.90"):
        assert part in told.headline
    assert "In 37 of 50 it lost more than half" in told.text
    gap = 0.9
    error = np.std(gap - 0.95 * SPREAD, ddof=1) / np.sqrt(50)
    assert f"differ by {gap:.3f} (standard error {error:.3f}" in told.text


def test_the_answer_that_turns_out_worse_is_said_to_be():
    told = verdict(
        report(shaken("highest observed", 3.0, 2.5 + 0.1 * SPREAD), shaken("recommended", 2.0, 1.9 + 0.1 * SPREAD))
    )
    assert not told.refused
    assert "do not bear it out" in told.headline


def test_a_difference_within_chance_is_said_to_be():
    rng = np.random.default_rng(0)
    a, b = rng.normal(2.0, 1.0, 50), rng.normal(2.0, 1.0, 50)
    told = verdict(report(shaken("highest observed", 3.0, a), shaken("recommended", 2.9, b)))
    assert not told.refused
    assert "about the same" in told.headline


def test_equal_means_but_one_often_fails():
    often_nothing = np.where(np.arange(50) % 4 == 0, 0.0, 2.6)
    told = verdict(
        report(shaken("highest observed", 3.0, often_nothing), shaken("recommended", 2.0, 2.0 + 0.05 * SPREAD))
    )
    assert told.refused
    assert "in 13 of 50 cases, the recommended point in none" in told.headline
    turned = verdict(
        report(shaken("highest observed", 3.0, 2.0 + 0.05 * SPREAD), shaken("recommended", 2.9, often_nothing))
    )
    assert not turned.refused


def test_a_flat_run_found_nothing():
    told = verdict(report(shaken("recommended", 0.0, 0.0 * SPREAD), y=np.array([0.0, 0.0, np.nan, 0.0])))
    assert told.headline == "All 3 trials gave the same value, 0: nothing was found."
    assert not told.refused


def test_one_candidate_and_no_queries():
    alone = verdict(report(shaken("recommended", 3.0, 2.9 + 0.01 * SPREAD), disturbance="the hand is off"))
    assert "also the recommended one" in alone.headline
    assert "when the hand is off" in alone.headline
    assert "does not ask what happens when the hand is off" in alone.text
    knowing = verdict(report(shaken("recommended", 3.0, 2.9 + 0.01 * SPREAD), robust_trace=np.ones(4)))
    assert "expects no other trial to hold better" in knowing.text
    quiet = verdict(report(shaken("recommended", 3.0, [])))
    assert "No re-queries" in quiet.text
    assert "dx = 3.10 mm, rx = 28.6°, s = 0.250" in quiet.text
    lost = verdict(report(replace(shaken("recommended", 3.0, []), n_failed=100)))
    assert "all 100 re-queries of it failed" in lost.headline


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.1356585, "0.136"),
        (-0.0004321, "−0.000432"),
        (12.3456, "12.3"),
        (1234.5, "1234"),
        (1e12, "1.00e12"),
        (1.2e-7, "1.20e−7"),
        (float("nan"), "–"),
        (None, "–"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


def test_change():
    assert change(shaken("a", 2.0, [1.0, 1.0])) == "−50\u00a0%"
    assert change(shaken("a", 2.0, [2.001, 2.0])) == "unchanged"
    assert change(shaken("a", 0.0, [1.0])) == ""
    assert change(shaken("a", -1.0, [1.0])) == ""


def test_coordinates_use_readable_units():
    there = replace(shaken("recommended", 1.0, []), x=np.array([-0.01, np.pi / 2, 1.0]))
    assert coordinates(report(there), there) == "dx = −10.0 mm, rx = 90.0°, s = 1.00"


def with_tail(label, quality, mean, worst, n=100):
    """Re-queries that are alike but for two of a hundred, which a mean hardly shows and a tail does."""
    values = np.full(n, mean) + 0.01 * np.sin(np.arange(n))
    values[:2] = worst
    return shaken(label, quality, values)


def test_bad_cases_decide_where_the_means_are_alike():
    """As `maximize rkhs` gives it: means of 4.84 and 4.94, the worst of a hundred 1.38 and 4.81."""
    told = verdict(report(with_tail("highest observed", 5.5, 4.84, 1.38), with_tail("recommended", 4.95, 4.84, 4.81)))
    assert told.refused
    for part in ("refused", "falls to 1.38 at worst", "to 4.81"):
        assert part in told.headline
    told = verdict(report(with_tail("highest observed", 5.5, 4.84, 4.81), with_tail("recommended", 4.95, 4.84, 1.38)))
    assert not told.refused
    assert "the recommended one falls to 1.38 at worst, the other to 4.81" in told.headline


def test_a_difference_of_bad_cases_counts_against_the_range_of_values():
    pair = (with_tail("highest observed", 5.5, 4.84, 4.5), with_tail("recommended", 4.95, 4.84, 4.81))
    assert "about the same: " in verdict(report(*pair, y=np.array([-5.0, 2.0, 5.5, np.nan]))).headline
    assert "falls to 4.50" in verdict(report(*pair, y=np.array([4.0, 4.5, 5.5, np.nan]))).headline


def test_a_better_mean_with_a_worse_tail_says_both():
    told = verdict(report(with_tail("highest observed", 5.5, 4.0, 3.9), with_tail("recommended", 4.95, 4.9, 1.38)))
    assert "worth only 4.00" in told.headline
    assert "but falls to 1.38 at worst" in told.headline


def averse(candidate, risk, predicted=None):
    return replace(candidate, risk=risk, predicted_worth=predicted)


def test_a_run_that_was_asked_for_a_risk_measure_is_judged_by_it():
    """The highest point has the higher mean; what the run was asked for is the mean of the worst tenth."""
    rng = np.random.default_rng(3)
    gamble, sound = 3.0 + 2.0 * rng.standard_normal(200), 2.5 + 0.1 * rng.standard_normal(200)
    pair = shaken("highest observed", 5.0, gamble), shaken("recommended", 2.6, sound)
    assert not verdict(report(*pair)).refused
    told = verdict(report(*(averse(candidate, Risk("cvar")) for candidate in pair)))
    worst = [np.sort(values)[:20].mean() for values in (gamble, sound)]
    assert told.refused
    assert f"worth only {number(worst[0])} by the mean of the worst 10 %, the recommended point" in told.headline
    assert f"the recommended point {number(worst[1])}." in told.headline
    assert f"The mean of the worst 10 % of them is {number(worst[1])}." in told.text
    assert f"By the mean of the worst 10 % they differ by {number(worst[1] - worst[0])} (" in told.text
    turned = verdict(report(*(averse(c, Risk("cvar")) for c in (shaken("highest observed", 5.0, sound), pair[0]))))
    assert "do not bear it out" in turned.headline


@pytest.mark.parametrize("paired", [True, False])
def test_the_standard_error_of_a_measure_is_that_of_normal_samples(paired):
    """Of s from n normal values it is sigma / sqrt(2 n), of the mean sigma / sqrt(n), and they are independent."""
    rng, n = np.random.default_rng(1), 4000
    one, other = rng.standard_normal((2, n))
    risk = Risk("mean-std", beta=2.0)
    pair = shaken("highest observed", 5.0, one), shaken("recommended", 3.0, 1.0 + other)
    if not paired:
        pair = pair[0], replace(pair[1], n_failed=1, without_value=1.0)
    told = verdict(report(*(averse(candidate, risk) for candidate in pair)))
    error = float(re.search(r"standard error ([\d.]+)", told.text)[1])
    assert error == pytest.approx(np.sqrt(2.0 * (1.0 / n + 4.0 / (2.0 * n))), rel=0.15)


def error_of(*pair):
    return float(re.search(r"standard error ([\d.]+)", verdict(report(*pair)).text)[1])


def test_the_standard_error_is_welchs_where_the_points_were_not_shaken_alike():
    one, other = np.random.default_rng(4).normal(2.0, [[0.1], [0.3]], (2, 60))
    pair = shaken("highest observed", 5.0, one), shaken("recommended", 4.0, 0.8 * one + 0.2 * other)
    assert error_of(*pair) == pytest.approx(stats.sem(pair[1].values - one), rel=0.05)
    apart = np.hypot(stats.sem(one), stats.sem(pair[1].values))
    assert error_of(pair[0], replace(pair[1], n_failed=1, without_value=2.0)) == pytest.approx(apart, rel=0.2)
    shorter = replace(pair[1], values=pair[1].values[:40])
    apart = np.hypot(stats.sem(one), stats.sem(shorter.values))
    assert error_of(pair[0], shorter) == pytest.approx(apart, rel=0.05)


def test_of_points_shaken_alike_the_error_of_a_measure_is_that_of_its_difference():
    one, other = np.random.default_rng(5).normal([[2.0], [0.1]], [[0.5], [0.01]], (2, 100))
    pair = [averse(shaken(name, 5.0, values), Risk("cvar")) for name, values in (("one", one), ("other", one + other))]
    assert error_of(*pair) < 0.01
    assert error_of(pair[0], replace(pair[1], values=pair[1].values[:99])) > 0.05
    assert error_of(pair[0], replace(pair[1], n_failed=1, without_value=2.0)) > 0.05


def test_the_bad_cases_are_looked_at_before_the_worst_one():
    """Of a hundred re-queries six are bad: the fifth lowest decides where the very lowest are alike."""
    one, other = (np.full(100, mean) + 0.01 * np.sin(np.arange(100)) for mean in (4.84, 4.72))
    one[:6] = 2.9
    one[0] = other[0] = 2.8
    told = verdict(report(shaken("highest observed", 5.5, one), shaken("recommended", 4.95, other)))
    assert told.refused
    assert "worth about the same" in told.headline


def test_a_worse_tail_is_told_from_a_notable_difference_on():
    pair = (with_tail("highest observed", 5.5, 4.0, 3.9), with_tail("recommended", 4.95, 4.9, 3.8))
    assert "but falls" not in verdict(report(*pair)).headline
    values = 4.9 + 0.01 * np.sin(np.arange(100))
    values[:8] = 1.38
    turned = (shaken("highest observed", 5.5, values), with_tail("recommended", 4.95, 4.0, 3.9))
    assert "although it falls only to 3.90 at worst (the other to 1.38)" in verdict(report(*turned)).headline
    turned = (with_tail("highest observed", 5.5, 4.9, 3.9), with_tail("recommended", 4.95, 4.0, 1.38))
    assert "although" not in verdict(report(*turned)).headline


def test_a_single_trial_is_not_said_to_be_all_of_the_same():
    told = verdict(
        report(
            shaken("recommended", 1.0, 0.9 + 0.01 * SPREAD, trial=0),
            y=np.ones(1),
            X=np.zeros((1, 3)),
            best_trace=np.ones(1),
        )
    )
    assert "nothing was found" not in told.headline


def test_the_worst_case_is_judged_by_the_lowest_re_query_alone():
    bad = [np.append(np.linspace(0.8, 0.9, 99), low) for low in (-1.0, 0.5)]
    pair = shaken("highest observed", 1.0, bad[0]), shaken("recommended", 0.9, bad[1])
    told = verdict(report(*(averse(candidate, Risk("worst")) for candidate in pair)))
    assert told.headline == (
        "The highest peak (1.00) was refused: when the input is off it is worth only −1.00 at worst, the recommended "
        "point 0.500."
    )
    assert "At worst they differ by 1.50 (both points shaken alike)." in told.text
    often = np.where(np.arange(100) < 10, 0.55, bad[0])  # one in ten is bad: no worse at worst
    told = verdict(
        report(averse(shaken("highest observed", 1.0, often), Risk("worst")), averse(pair[0], Risk("worst")))
    )
    assert "about the same" in told.headline
    assert not told.refused


def test_the_headline_of_a_single_point_states_the_measure():
    alone = averse(shaken("recommended", 3.0, 2.0 + SPREAD), Risk("cvar", alpha=0.2))
    worst = number(np.sort(2.0 + SPREAD)[:10].mean())
    assert (
        f"2.00 on average, {worst} by the mean of the worst 20 % and 1.00 at worst" in verdict(report(alone)).headline
    )


@pytest.mark.parametrize("name", ["worst", "cvar", "var"])
def test_a_re_query_without_a_value_is_no_merit(name):
    sound = averse(shaken("highest observed", 1.0, np.linspace(0.8, 0.9, 100)), Risk(name))
    lucky = averse(shaken("recommended", 0.96, np.full(20, 0.95)), Risk(name))
    lost = replace(lucky, n_failed=80, without_value=-3.0)
    assert verdict(report(sound, lucky)).refused == (name != "worst")  # by .15 of a range of 2 it is a tie
    assert lost.worth == pytest.approx(-3.0)
    told = verdict(report(sound, lost))
    assert not told.refused
    assert "do not bear it out" in told.headline


def test_re_queries_that_fail_are_said_first():
    values = 2.0 + 0.01 * SPREAD
    fails = replace(shaken("recommended", 2.0, values[:40]), n_failed=10)
    told = verdict(report(fails, robust_trace=np.zeros(4)))
    assert "2.00 on average and no value at worst" in told.headline
    assert told.headline.endswith("10 of 50 re-queries of the recommended point failed.")
    assert fails.worst == fails.bad == -np.inf
    assert replace(fails, minimized=True).bad == np.inf
    assert replace(fails, n_failed=1).bad == np.sort(values[:40])[1]  # of 41 two count as bad
    sound = shaken("highest observed", 2.1, values)
    assert "falls to no value at worst" in verdict(report(sound, fails)).headline


def test_a_point_whose_re_queries_all_fail_does_not_hold():
    nothing = replace(shaken("recommended", 2.0, []), n_failed=50, predicted_mean=1.9)
    told = verdict(report(nothing))
    assert told.headline.startswith("The recommended point does not hold")
    peak = replace(shaken("highest observed", 3.0, []), n_failed=50)
    told = verdict(report(peak, shaken("recommended", 2.0, 2.0 + 0.01 * SPREAD)))
    assert told.refused
    assert "all 50 re-queries of it failed, the recommended point is worth 2.00 on average" in told.headline
    assert told.headline.count("failed") == 1


def test_points_that_are_worth_the_same_are_said_to_be_whatever_the_error():
    values = 4.0 + 0.1 * SPREAD
    told = verdict(report(shaken("highest observed", 5.0, values), shaken("recommended", 4.9, values + 1e-5)))
    assert "about the same: 4.00 and 4.00 on average" in told.headline
    worst = [averse(shaken(name, 5.0, values), Risk("worst")) for name in ("highest observed", "recommended")]
    assert verdict(report(*worst)).headline.endswith("about the same: 3.90 and 3.90 at worst.")


def test_without_re_queries_the_model_says_what_the_measure_is():
    pair = [
        replace(averse(shaken(name, 3.0, []), Risk("var", alpha=0.2), worth), predicted_mean=mean)
        for name, worth, mean in (("highest observed", -1.5, 2.0), ("recommended", 1.25, 1.5))
    ]
    told = verdict(report(*pair, robust_trace=np.ones(4)))
    assert "expects −1.50 of it by the 20 % quantile, and 1.25 of the recommended point" in told.headline
    pair = [replace(candidate, minimized=True) for candidate in pair]
    assert "by the 80 % quantile" in verdict(report(*pair, minimized=True)).headline


def test_without_any_success_nobody_wins():
    told = verdict(
        report(
            shaken("highest observed", 0.0, SPREAD),
            shaken("recommended", -1.0, 1.9 + SPREAD),
            y=np.array([0.0, -1.0, -1.0, np.nan]),
            success_above=0.0,
            outcomes={"not closed": 1, "no contact": 3},
            advice="Try another --facet.",
        )
    )
    assert told.headline == "None of 4 trials succeeded: no value above 0 was met."
    assert told.text.startswith("How they ended: 3 × no contact; 1 × not closed.")
    assert told.text.endswith("Try another --facet.")
    assert not told.refused


def mirrored(candidate):
    other = replace(candidate, quality=-candidate.quality, values=-candidate.values, minimized=True)
    return replace(other, label=candidate.label.replace("highest", "lowest"))


@pytest.mark.parametrize(
    ("observed", "answer"),
    [
        ((3.0, 1.0 + SPREAD), (2.0, 1.9 + 0.05 * SPREAD)),
        ((3.0, 2.5 + 0.1 * SPREAD), (2.0, 1.9 + 0.1 * SPREAD)),
        ((3.0, np.where(SPREAD > 0.9, -4.0, 2.0)), (2.0, np.where(SPREAD > 0.9, 1.0, 1.65))),
    ],
)
def test_minimizing_is_maximizing_seen_in_a_mirror(observed, answer):
    """The same verdict, in words of the other direction and in the user's own sign."""
    pair = shaken("highest observed", *observed), shaken("recommended", *answer)
    up = verdict(report(*pair))
    y = np.array([-1.0, -2.0, -3.0, np.nan])
    down = verdict(report(*map(mirrored, pair), y=y, best_trace=np.fmin.accumulate(y), minimized=True))
    assert down.refused == up.refused
    assert number(-pair[1].mean) in down.headline
    assert "highest" not in down.headline + down.text
    assert "falls" not in down.headline
    assert ("lowest dip" in down.headline) == ("highest peak" in up.headline)


def test_the_paragraph_ends_with_what_is_wrong_with_the_model():
    candidates = (shaken("recommended", 3.0, 2.5 + 0.1 * SPREAD),)
    told, warned = (verdict(report(*candidates, warning=warning)) for warning in ("", "The model is blind."))
    assert warned.text == f"{told.text} The model is blind."
    assert warned.headline == told.headline


def test_values_far_from_zero_are_shown_with_the_digits_that_tell_them_apart():
    """A pressure of 1013 to 1014: at three digits everything would be 1010."""
    run = {"y": np.array([1013.1, 1014.0, 1014.6, np.nan]), "best_trace": np.array([1013.1, 1014.0, 1014.6, 1014.6])}
    sides = (
        shaken("highest observed", 1014.6, 1013.2 + 0.1 * SPREAD),
        shaken("recommended", 1014.0, 1013.9 + 0 * SPREAD),
    )
    told = verdict(report(*sides, **run))
    assert "The highest peak (1014.60) was refused" in told.headline
    assert "it is worth only 1013.20, the recommended point 1013.90" in told.headline
    assert report(*sides).more_digits == 0
    near = replace(sides[1], x=np.array([1000.123, 0.0]))
    two = {"variables": (Variable("k", 1000.0, 1000.5), Variable("f", -7.0, 0.0, "log N")), "X": np.zeros((4, 2))}
    assert coordinates(report(near, **run, **two), near) == "k = 1000.12, f = 1.00 N"


def test_shares_of_several_executions_are_not_said_to_be_trials():
    answer = replace(shaken("recommended", 1.0, []), predicted_mean=0.8, predicted_error=0.1)
    told = verdict(report(answer, y=np.array([1.0, 0.5, 0.0, 1.0]), counted=True))
    assert "The 4 trials succeeded in 62.5 % of their executions on average" in told.text
    told = verdict(report(answer, y=np.array([1.0, 0.0, 0.0, 1.0]), counted=True))
    assert "50 % of the 4 trials succeeded" in told.text


def test_a_lower_value_is_no_loss_where_values_are_minimized():
    sides = [
        replace(shaken(label, quality, values), minimized=True)
        for label, quality, values in (
            ("lowest observed", 0.01, 0.2 + 0 * SPREAD),
            ("recommended", 0.3, 0.1 + 0 * SPREAD),
        )
    ]
    told = verdict(report(*sides, y=np.array([0.01, 0.3, 0.9, np.nan]), best_trace=np.full(4, 0.01), minimized=True))
    assert told.headline == (
        "The lowest dip (0.0100) was refused: when the input is off it is as high as 0.200, "
        "the recommended point 0.100."
    )
    assert "lost more than half" not in told.text
