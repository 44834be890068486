import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.power import TTestPower

from surehold.campaigns.comparison import claim_results, comparisons, final_values, measures_of, rows_of, traces
from surehold.campaigns.costs import cost_table, total_cost_table
from surehold.campaigns.published import ORIGINAL_SECONDS, published, published_tables
from surehold.campaigns.sections import (
    campaign_section,
    claims_table,
    curves,
    open_places_table,
    plus_minus_remark,
)
from surehold.campaigns.table import Records
from surehold.campaigns.thesis import CLAIMS, OPEN_PLACES
from surehold.problems.synthetic import RKHS


def records_of(plan, runs, results, measure="best", **more):
    """Records as the tables give them: `results` {(problem, method): final values by seed}."""
    cells = [
        {"problem": p, "method": m, "function": p.lower(), "input_noise": None, "initial": 2, "trials": 4}
        for p, m in results
    ]
    records = Records({"plan": plan, "title": plan, "note": "", "runs": runs, "cells": cells, "format": "x"})
    for (p, m), values in results.items():
        for seed, value in enumerate(values):
            row = {"problem": p, "method": m, "seed": seed, "status": "done", "trials": 4, "cpu_seconds": 2.0}
            row |= {"initial": 2, "ask_seconds": [0.0, 0.0, 0.25, 0.35]}
            row |= {measure: [[0, value - 1.0], [2, value]], "versions": {"source": "a"}, **more}
            records.rows[p, m, seed] = row
    return records


def drawn(mean, std, n, seed=0):
    x = np.random.default_rng(seed).standard_normal(n)
    return (mean + std * (x - x.mean()) / x.std(ddof=1)).tolist()


def test_published_numbers_are_the_printed_ones():
    gp = published("4.1", "RKHS", "GP", "best")
    assert gp is not None
    assert (gp.mean, gp.pm, gp.runs, gp.unit) == (5.3279, 0.0642, 100, 1e-4)
    assert gp.std == pytest.approx(6.02 * 0.0642, rel=1e-3)
    worst = published("4.4", "glass", "UBO", "worst")
    assert worst is not None
    assert (worst.mean, worst.pm, worst.std, worst.runs) == (0.252, None, None, 30)
    drill = published("4.2", "drill side", "TGP-winf", "best")
    assert drill is not None
    assert (drill.mean, drill.pm) == (0.1239, 0.0096)
    assert published("4.3", "noise 0.2", "TGP-w3", "best").mean == 5.3287
    assert published("4.1", "RKHS", "TGP-w4", "best") is None
    assert published_tables() == ["4.1", "4.2", "4.3", "4.4"]
    assert ORIGINAL_SECONDS["GM", "TGP-w1"] == 230.0


def test_final_values_and_traces():
    records = records_of("mine", 3, {("a", "m"): [1.0, 2.0, 3.0]})
    assert final_values(records, "a", "m", "best") == {0: 1.0, 1: 2.0, 2: 3.0}
    assert traces(records, "a", "m", "best").tolist() == [[v - 1, v - 1, v, v] for v in (1.0, 2.0, 3.0)]
    records.rows["a", "m", 1]["status"] = "failed"
    assert final_values(records, "a", "m", "best") == {0: 1.0, 2: 3.0}
    (row,) = rows_of(records)
    assert row.failed == 1
    records.rows["b", "m", 0] = records.rows["a", "m", 1] | {"problem": "b"}
    assert rows_of(records)[0].failed == 1, "runs of other problems count for those"
    records.rows = dict(reversed(records.rows.items()))  # runs end in any order
    assert list(final_values(records, "a", "m", "best")) == [0, 2]


@pytest.mark.parametrize(
    ("mean", "verdict"), [(5.3279, "agrees"), (5.40, "agrees"), (5.7, "better"), (5.0, "differs"), (5.32794, "agrees")]
)
def test_verdicts_beside_the_published_number(mean, verdict):
    records = records_of("table-4.1", 100, {("RKHS", "GP"): drawn(mean, 0.386, 100)})
    (row,) = rows_of(records)
    assert row.verdict == verdict
    assert row.ours.n == row.planned == 100
    assert (row.seconds, row.ask_seconds) == (2.0, pytest.approx(0.3))
    expected = stats.ttest_ind_from_stats(mean, 0.386, 100, 5.3279, row.theirs.std, 100, equal_var=False).pvalue
    assert row.p == pytest.approx(expected, rel=1e-6)


def test_a_low_standard_deviation_is_better():
    values = drawn(0.3, 0.1, 100)
    records = records_of("table-4.4", 100, {("RKHS", "BO"): values}, "std", mean=[[0, 4.0]], worst=[[0, 1.0]])
    row = next(row for row in rows_of(records) if row.measure == "std")
    assert row.verdict == "better"  # 0.3 against the published 0.554
    higher = records_of("table-4.4", 100, {("RKHS", "BO"): drawn(0.9, 0.1, 100)}, "std")
    assert next(row for row in rows_of(higher) if row.measure == "std").verdict == "differs"
    results = {("a", "first"): drawn(0.9, 0.1, 30), ("a", "second"): values[:30]}
    records = records_of("mine", 30, results, "std", mean=[[0, 4.0]], worst=[[0, 1.0]])
    records.header["cells"][0]["input_noise"] = 0.1
    assert next(told for told in comparisons(records) if told.measure == "std").verdict == "better"


def test_rows_without_runs_say_so():
    records = records_of("table-4.1", 100, {("RKHS", "GP"): [], ("GM", "GP"): [0.12]})
    first, second = rows_of(records)
    assert first.ours is None
    assert first.verdict == ""
    assert math.isnan(second.p)
    text = campaign_section(records).tables[0].rows
    assert text[0][2] == "0 of 100"
    assert text[0][-1] == "no runs"


def test_p_values_are_adjusted_within_the_table():
    results = {("RKHS", m): drawn(5.4, 0.4, 100, i) for i, m in enumerate(("GP", "TGP-w1", "TGP-w2"))}
    alone = [rows_of(records_of("table-4.1", 100, {key: values}))[0].p for key, values in results.items()]
    together = [row.p for row in rows_of(records_of("table-4.1", 100, results))]
    assert min(together) == pytest.approx(min(1.0, 3 * min(alone)))


def test_methods_are_compared_on_common_seeds():
    base = drawn(1.0, 0.3, 30)
    better = [v + 0.05 for v in base]
    records = records_of("mine", 30, {("a", "first"): base, ("a", "second"): better[:20]})
    (told,) = comparisons(records)
    assert told.difference.n == 20
    assert told.difference.mean == pytest.approx(0.05)
    assert told.verdict == "better"
    (told,) = comparisons(records_of("mine", 30, {("a", "first"): better, ("a", "second"): base}))
    assert told.verdict == "worse"
    (told,) = comparisons(records_of("mine", 30, {("a", "first"): base, ("a", "second"): drawn(1.0, 0.3, 30, 9)}))
    assert told.verdict == "no difference shown"
    assert comparisons(records_of("mine", 30, {("a", "first"): base, ("a", "second"): better[:1]})) == []


def test_the_smallest_effect_is_a_share_of_the_size_of_values_below_zero_too():
    base = drawn(-100.0, 1.0, 30)
    for gain, verdict in ((0.4, "no difference of interest"), (0.6, "better")):
        better = [value + gain for value in base]
        (told,) = comparisons(records_of("mine", 30, {("a", "first"): base, ("a", "second"): better}))
        assert told.verdict == verdict


def test_problems_under_their_own_noise_are_compared_by_regret_where_all_are():
    records = records_of("mine", 1, {("a", "m"): [1.0], ("b", "m"): [1.0]})
    one, other = records.header["cells"]
    one["input_noise"] = other["input_noise"] = "own"
    assert measures_of(records) == ("regret", "mean")
    other["input_noise"] = 0.1
    assert measures_of(records) == ("mean", "worst", "std")
    one["input_noise"] = other["input_noise"] = None
    assert measures_of(records) == ("best",)


def test_differences_below_the_smallest_effect_are_no_verdict():
    """0.002 % of the maximum, shown by a hundred seeds beyond any doubt, is of no interest to anybody."""
    top = RKHS().optimum.value
    base = drawn(0.98 * top, 0.01, 100)

    def told(shift):
        other = [b + shift + e for b, e in zip(base, drawn(0.0, abs(shift) / 10.0, 100, 4), strict=True)]
        records = records_of("table-4.1", 100, {("RKHS", "GP"): base, ("RKHS", "TGP-winf"): other})
        claims = claim_results({"table-4.1": records})
        return comparisons(records)[0], next(t for t in claims if t.result and t.claim.better == "TGP-winf")

    for sign in (1.0, -1.0):
        pair, claim = told(sign * 2e-5 * top)
        assert pair.p < 1e-6
        assert (pair.verdict, claim.verdict) == ("no difference of interest", "not shown")
        assert claim.reason.endswith("below the smallest of interest, 0.029")
    assert [t.verdict for t in told(0.006 * top)] == ["better", "holds"]
    assert [t.verdict for t in told(-0.006 * top)] == ["worse", "contradicted"]


def test_the_smallest_effect_is_that_of_the_best_method_below_zero_too():
    """Of values around -10 a gain of 0.2 is 2 %, also beside a method that ends at -100."""
    base = drawn(-10.0, 0.1, 30)
    better = [v + 0.2 for v in base]
    results = {("a", "first"): base, ("a", "second"): better, ("a", "random"): drawn(-100.0, 1.0, 30)}
    assert [told.verdict for told in comparisons(records_of("mine", 30, results))] == ["better", "worse"]


@pytest.mark.parametrize(
    ("shift", "rkhs", "gf"),
    [(0.2, "holds", "contradicted"), (0.0, "not shown", "holds"), (-0.2, "contradicted", "holds")],
)
def test_claims(shift, rkhs, gf):
    base = drawn(5.0, 0.3, 100)
    noise = drawn(0.0, 0.05, 100, 4)
    other = [b + shift + e for b, e in zip(base, noise, strict=True)]
    results = {(p, m): other if m == "TGP-winf" else base for p in ("RKHS", "GF") for m in ("GP", "TGP-winf")}
    told = claim_results({"table-4.1": records_of("table-4.1", 100, results)})
    assert len(told) == 2 * len(CLAIMS)
    verdicts = {(t.claim.problem, t.plan): t.verdict for t in told if t.claim.better == "TGP-winf"}
    assert verdicts["RKHS", "table-4.1"] == rkhs
    assert verdicts["GF", "table-4.1"] == gf
    assert verdicts["GM", "table-4.1"] == "no runs"
    assert verdicts["RKHS", "table-4.1-defaults"] == "no runs"


def test_claims_that_are_not_shown_come_with_what_is_seen():
    top = RKHS().optimum.value
    results = {("RKHS", "GP"): [top] * 29 + [0.991 * top, 0.989 * top], ("RKHS", "TGP-winf"): [top] * 31}
    told = claim_results({"table-4.1": records_of("table-4.1", 100, results)})
    (first,) = [t for t in told if t.claim.better == "TGP-winf" and t.claim.problem == "RKHS" and t.result]
    assert first.verdict == "not shown"
    assert first.reason.startswith("within 1 % of the maximum end 30 of 31 runs of GP and 31 of 31 of TGP-winf")
    few = {key: values[:5] for key, values in results.items()}
    told = claim_results({"table-4.1": records_of("table-4.1", 100, few)})
    assert next(t.verdict for t in told if t.result) == "too few runs"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_differences_that_are_not_shown_stand_beside_the_printed_ones(sign):
    base, gains = drawn(0.42, 0.1, 30), drawn(0.02, 0.1, 30, 5)
    other = [b + sign * g for b, g in zip(base, gains, strict=True)]
    results = {("glass", "BO"): base, ("glass", "UBO"): other}
    told = claim_results({"table-4.4-grasps": records_of("table-4.4-grasps", 30, results, "mean")})
    (mean,) = [t for t in told if t.result]
    printed, alone, seen = mean.reason.split("; ")
    assert mean.verdict == "not shown"
    assert printed == f"printed is a difference of 0.031, {0.031 / (0.1 / 30**0.5):.1f} of our standard errors"
    assert alone == "BO alone ends with 0.42 here, 0.42 in print"
    if sign < 0.0:
        assert seen == "ours has the other sign"
    else:
        needed = TTestPower().solve_power(effect_size=0.2, alpha=0.05, power=0.8)
        assert int(seen.removeprefix("about ").removesuffix(" seeds would show ours")) == pytest.approx(
            needed, rel=0.02
        )


def test_equal_answers_everywhere_need_no_number_of_seeds():
    results = {("glass", m): drawn(0.05, 0.01, 30) for m in ("BO", "UBO")}
    told = claim_results({"table-4.4-grasps": records_of("table-4.4-grasps", 30, results, "std")})
    (only,) = [t for t in told if t.result]
    assert (only.verdict, only.reason) == ("not shown", "both give the same answer on 30 of 30 seeds")


def test_grasps_have_no_known_maximum_to_be_near_to():
    results = {("glass side", "GP"): drawn(0.45, 0.1, 30), ("glass side", "TGP-winf"): drawn(0.45, 0.1, 30, 5)}
    told = claim_results({"table-4.2": records_of("table-4.2", 30, results)})
    (only,) = [t for t in told if t.result]
    assert only.verdict == "not shown"
    assert "printed is a difference of 0.0058" in only.reason


def test_curves_are_means_with_bands_and_the_first_split():
    results = {("RKHS", "GP"): drawn(5.0, 0.5, 25), ("RKHS", "TGP-winf"): drawn(5.5, 0.5, 25)}
    records = records_of("table-4.1", 100, results)
    for (_, method, seed), row in records.rows.items():
        if method == "TGP-winf":
            row["first_split"] = 3 + seed % 2
    (picture,) = curves(records)
    (panel,) = picture.panels  # the problems without runs are left out
    line, band = panel.lines[0], panel.bands[0]
    assert line.y == pytest.approx([4.0, 4.0, 5.0, 5.0])
    assert band.high - line.y == pytest.approx(np.full(4, 1.66 * 0.5 / 5.0))
    assert panel.verticals == ((3.0, "first split"),)
    assert panel.initial == 2.0


def test_costs_stand_beside_the_originals():
    table = cost_table({"table-4.1": records_of("table-4.1", 100, {("GM", "GP"): drawn(0.1, 0.01, 10)})})
    assert table.rows == (("GM", "GP", "thesis", "2.00", "101", "50", "0.056", "2.8"),)


def test_a_campaign_is_priced_by_the_runs_made():
    values = {("RKHS", "GP"): [5.0] * 30, ("RKHS", "TGP-winf"): [5.0] * 15}
    row = total_cost_table({"table-4.1": records_of("table-4.1", 100, values)}).rows[0]
    assert row == ("table-4.1", "45 of 200", "1.50", "6.67")  # 2 s a run
    former = records_of("table-4.1", 100, values | {("RKHS", "of a former plan"): [5.0] * 60})
    former.header["cells"].pop()  # its runs are not counted, nor is their time
    assert total_cost_table({"table-4.1": former}).rows[0] == row
    values["GM", "GP"] = []
    assert total_cost_table({"a": records_of("table-4.1", 100, values)}).rows[0][-1] == "–"


def test_the_printed_plus_minus_is_remarked_upon():
    records = records_of("table-4.1", 100, {("RKHS", "GP"): drawn(5.3, 6.0 * 0.0642, 100)})
    assert "6.02 times" in plus_minus_remark({})
    assert "6.0 times the printed ± (median of 1 rows)" in plus_minus_remark({"table-4.1": records})


def test_claims_and_open_places_fill_their_tables():
    records = {"table-4.1": records_of("table-4.1", 100, {("RKHS", "GP"): [1.0]})}
    assert len(claims_table(records).rows) == sum(claim.plan == "table-4.1" for claim in CLAIMS)
    assert len(open_places_table().rows) == len(OPEN_PLACES) > 10


def test_a_method_that_mostly_gains_and_loses_more_by_the_mean_is_not_called_better():
    few = np.full(3, -5.0)  # of 30 seeds three end in a disaster
    gains = np.concatenate([0.1 + 0.01 * np.arange(27), few])
    records = records_of("mine", 30, {("a", "first"): np.ones(30).tolist(), ("a", "second"): (1.0 + gains).tolist()})
    (told,) = comparisons(records)
    assert stats.wilcoxon(gains).pvalue < 0.05
    assert told.p < 0.05
    assert told.difference.mean < 0.0 < told.difference.r
    assert told.verdict == "no difference shown"
    gains = np.append(np.arange(1.0, 30.0), -435.0)  # of no gain by the mean at all
    records = records_of("mine", 30, {("a", "first"): [0.0] * 30, ("a", "second"): gains.tolist()})
    (told,) = comparisons(records)
    assert told.p < 0.05
    assert told.verdict == "no difference shown"
