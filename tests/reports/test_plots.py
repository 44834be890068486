"""Pictures of a result made from Python."""

import json

import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.reports.figures import figures
from surehold.reports.page import render, table_rows
from surehold.reports.plots import result_report
from surehold.reports.verdict import verdict
from surehold.reports.wording import coordinates, worth

BOX = sh.Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]})


def needle(x):
    return float(np.exp(-0.5 * ((x[0] - 0.3) / 0.15) ** 2) + 0.8 * np.exp(-0.5 * ((x[0] - 0.8) / 0.012) ** 2))


@pytest.fixture(scope="module")
def result():
    box = sh.Box({"x": (0.0, 1.0)})
    return sh.maximize(needle, box, 20, n_initial=8, seed=0, input_noise=sh.InputNoise.unit(0.05))


def labels(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_a_picture_of_the_model_and_of_the_re_queries(result, tmp_path):
    figure = result.plot(needle)
    figure.savefig(tmp_path / "run.png")
    titles = [axes.get_title(loc="left") for part in figure.subfigs for axes in part.axes]
    assert any("100 re-queries" in title for title in titles)
    (line,) = [
        axes for part in figure.subfigs for axes in part.axes if axes.get_title(loc="left") == "Model and trials"
    ]
    mean = line.lines[0]
    x = float(mean.get_xdata()[100])
    assert mean.get_ydata()[100] == pytest.approx(result.optimizer.predict([[x]])[0][0], rel=1e-9)


def test_without_the_function_the_model_stands_for_it(result):
    report = result_report(result)
    assert report.recommended.values.size == 0
    assert report.recommended.predicted_mean == result.recommendation.mean
    assert result_report(result, needle).recommended.values.size == 100


def test_under_a_risk_measure_everything_that_compares_is_of_that():
    """The spike is at .8; of the mean of the worst tenth it has nothing."""
    box, risk = sh.Box({"x": (0.0, 1.0)}), sh.Risk("cvar", alpha=0.1)
    found = sh.maximize(needle, box, 14, n_initial=8, seed=0, input_noise=sh.InputNoise.unit(0.05), risk=risk)
    optimizer, best = found.optimizer, found.recommendation
    silent, shaken = result_report(found), result_report(found, needle)
    assert silent.recommended.predicted_worth == best.by_risk == pytest.approx(optimizer.risk_measure(best.x)[0])
    assert silent.robust_trace is not None
    assert silent.robust_trace[-1] == best.by_risk
    assert silent.settings["risk"] == "cvar=0.1"
    tail = np.sort(shaken.recommended.values)[:10].mean()
    assert shaken.recommended.worth == pytest.approx(tail)
    rows = dict(table_rows(shaken))
    assert rows["mean of the worst 10 % of them"][-1] == worth(shaken, tail, 4)
    assert rows["model: mean of the worst 10 %"][-1] == worth(shaken, best.by_risk, 4)
    page = render(shaken)
    assert f"recommended: expected {risk.words()}" in page
    assert f"(◆ {risk.words()} {worth(shaken, tail)})" in page
    assert f"{risk.words()}</dt>" in page, "the glossary has it"


def test_the_page_is_written_from_python(result, tmp_path):
    path = result.report(tmp_path / "page", needle, title="The needle")
    assert "The needle" in path.read_text(encoding="utf-8")
    assert json.loads((tmp_path / "page" / "result.json").read_text())["trials"]["y"] == result.y.tolist()


def test_slices_go_through_the_point(result):
    figure = result.optimizer.plot_slice([0.5])
    (axes,) = figure.axes
    assert {"averaged over the input noise", "the point", "trials, projected"} <= set(labels(figure))
    (point,) = [line for line in axes.lines if line.get_label() == "the point"]
    assert point.get_xdata()[0] == 0.5
    assert result.optimizer.plot_slice().axes[0].lines[-1].get_xdata()[0] == result.recommendation.x[0]
    with pytest.raises(InputError, match="one point"):
        result.optimizer.plot_slice([2.0])


def test_boxes_of_many_kinds_are_drawn(tmp_path):
    mixed = sh.minimize(
        lambda p: abs(np.log(p["force"])) + (p["grip"] == "pinch"),
        BOX,
        12,
        seed=0,
        input_noise=sh.InputNoise({"force": 0.05}),
    )
    report = result_report(mixed, lambda p: abs(np.log(p["force"])) + (p["grip"] == "pinch"))
    assert report.choices["grip"][report.recommended.trial] == "power"
    assert "trials, projected" in figures(report)["surface"].axes[0].get_legend_handles_labels()[1]
    assert report.recommended.mean < 0.2
    force, grip = mixed.optimizer.plot_slice({"force": 1.0, "grip": "power"}).axes
    assert force.get_xscale() == "log"
    assert force.get_xlim() == pytest.approx((0.1, 10.0))
    assert [text.get_text() for text in grip.get_xticklabels()] == ["pinch", "power"]
    assert "force [log]" not in mixed.report(tmp_path / "mixed").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def mixed():
    def f(p):
        return np.exp(-(np.log(p["force"] / 1.7) ** 2)) * (1.0 - 0.4 * abs(p["fingers"] - 3))

    box = sh.Box({"force": (0.1, 10.0, "log"), "fingers": (2, 5, "int")})
    return sh.maximize(f, box, 14, input_noise=sh.InputNoise({"force": 0.1, "fingers": 0}), seed=0)


def test_a_map_is_in_the_units_of_its_variables(mixed):
    report = result_report(mixed)
    figure = figures(report)["surface_mean"]
    figure.draw_without_rendering()
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("force", "fingers")
    assert axes.get_xlim() == pytest.approx((0.1, 10.0), rel=0.1)
    assert {text.get_text() for text in axes.get_xticklabels()} >= {"0.1", "1", "10"}
    assert {float(tick) % 1.0 for tick in axes.get_yticks()} == {0.0}
    marks = axes.lines[-1].get_xydata()
    assert marks[0] == pytest.approx([np.exp(report.recommended.x[0]), report.recommended.x[1]])
    ellipse = np.log(axes.lines[-2].get_xdata()) - report.recommended.x[0]
    assert ellipse.max() == pytest.approx(0.2, rel=1e-3), "two standard deviations of the logarithm"
    left, right = axes.images[0].get_window_extent().intervalx
    assert (left, right) == pytest.approx(tuple(axes.get_window_extent().intervalx)), "the picture fills the axes"


def test_a_close_view_of_a_whole_number_is_no_narrower_than_a_step(mixed):
    report = result_report(mixed)
    close = report.surfaces[1]
    level = round(float(report.recommended.x[1]))
    assert close.axes[1][0] == pytest.approx(level - 1.0)
    assert close.axes[1][-1] == pytest.approx(level + 1.0)
    assert close.axes[0][-1] - close.axes[0][0] < np.log(100.0) / 2
    axes = figures(report)["surface_mean_close"].axes[0]
    shown = [tick for tick in axes.get_xticks() if axes.get_xlim()[0] <= tick <= axes.get_xlim()[1]]
    assert len(shown) >= 2, "less than a decade has numbers, too"
    assert {float(tick) % 1.0 for tick in axes.get_yticks()} == {0.0}


def test_whole_numbers_are_printed_as_such(mixed):
    report = result_report(mixed)
    level = str(round(float(report.recommended.x[1])))
    assert dict(table_rows(report))["fingers"][-1] == level
    assert coordinates(report, report.recommended).endswith(f"fingers = {level}")
    assert "ln force ± 0.1" in render(report)


def test_a_run_without_a_success_recommends_nothing(tmp_path):
    box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.03)
    run = sh.maximize(lambda x: False, box, 8, input_noise=noise, outcome="success", seed=0)
    told = verdict(result_report(run))
    assert told.headline == "None of 8 trials succeeded."
    assert "The point shown is no answer. Give more trials" in told.text
    page = run.report(tmp_path / "none").read_text(encoding="utf-8")
    assert '<p class="headline">None of 8 trials succeeded.' in page
    assert "expected to succeed in" not in page


def test_a_trial_that_met_a_good_condition_is_refused():
    def grip(x):
        return float(x[1] - 3.0 * (x[0] - x[1]) ** 2)

    box = sh.Box({"grip": (0.0, 1.0)}, uncontrolled={"load": [0.2, 0.3, 0.8]})
    report = result_report(sh.maximize(grip, box, 15, seed=0), grip)
    assert report.observed.quality > report.recommended.quality, "it was lucky"
    assert report.observed.mean < report.recommended.mean
    assert set(np.round(report.recommended.values, 6)) == {
        round(grip((report.recommended.x[0], load)), 6) for load in (0.2, 0.3, 0.8)
    }
    told = verdict(report)
    assert "when conditions differ" in told.headline + told.text
    assert report.robust_trace is not None


def test_re_queries_that_were_kept_in_the_box_are_told():
    box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.1)
    result = sh.maximize(lambda x: float(x[0]), box, 9, input_noise=noise, seed=0)
    assert result.recommendation.x[0] > 0.99
    report = result_report(result, lambda x: float(x[0]))
    kept = int(np.sum(report.recommended.points[:, 0] == report.recommended.x[0]))
    assert 30 < kept < 70
    assert any(f"(in {kept} of 100 of the recommended point)" in note for note in report.notes)
    assert not any("kept its commanded value" in note for note in result_report(result).notes)
