import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.maximization import Result
from surehold.optimization.surrogates.protocol import mixture
from surehold.problems import GaussianBumps, robust_score
from surehold.reports import gather
from surehold.reports.plots import result_report
from surehold.reports.surfaces import surfaces_of
from surehold.reports.verdict import verdict
from surehold.reports.wording import coordinates


def test_answers_and_traces(gm_result, gm_report):
    labels = gather.answers(gm_result)
    assert list(labels) == ["highest observed", "recommended"]
    assert gm_result.y[labels["highest observed"]] == np.max(gm_result.y)
    np.testing.assert_array_equal(gm_result.X[labels["recommended"]], gm_report.recommended.x)
    np.testing.assert_array_equal(gm_report.best_trace, np.maximum.accumulate(gm_result.y))
    assert np.isnan(gm_report.robust_trace[:8]).all()
    assert gm_report.robust_trace[-1] == gm_result.recommendation.mean == gm_report.recommended.predicted_mean
    np.testing.assert_allclose(gm_report.noise, 0.01 * np.eye(2))


def test_where_nothing_succeeded_no_recommended_input_is_near_the_border():
    result = sh.maximize(lambda x: x[0], sh.Box({"x": (0.0, 1.0)}), 6, input_noise=sh.InputNoise.unit(0.2), seed=0)
    shown = [gather.candidate(result, "recommended", result.best_index, None)]

    def notes(least):
        report = gather.report_of(result, shown, title="", settings={}, noise=None, success_above=least, surfaces=())
        return " ".join(report.notes)

    assert "The recommended input is near the border" in notes(None)
    assert not notes(2.0)


def averaged(optimizer, x, deviations):
    """Return the model's mean averaged over normal noise at x (d,), by Gauss and Hermite's product rule of NumPy."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    grids = np.meshgrid(*[nodes] * len(x), indexing="ij")
    product = np.prod(np.meshgrid(*[weights / weights.sum()] * len(x), indexing="ij"), axis=0)
    points = x + np.stack([grid.ravel() for grid in grids], axis=1) * deviations
    mean = mixture(optimizer.posterior.moments(optimizer.box.to_unit(points)))[0]
    return product.ravel() @ mean


def test_the_answer_over_conditions_is_the_trial_of_its_setting():
    """The nearest trial in all variables would be one of another setting, made at about the mean condition."""
    box = sh.Box({"x": (0.0, 1.0)}, uncontrolled={"w": [0.0, 0.0, 0.5, 1.0, 1.0]})
    result = sh.maximize(lambda p: -((p[0] - 0.6) ** 2) * (1.0 + p[1]), box, 9, seed=0)
    x = result.recommendation.x
    index = gather.answers(result)["recommended"]
    assert result.X[index, 0] == pytest.approx(x[0], abs=1e-9)
    nearest = int(np.argmin(np.abs(box.to_unit(result.X) - box.to_unit(x)).max(axis=1)))
    assert abs(result.X[nearest, 0] - x[0]) > 1e-6, "the nearest trial is the right one: the test shows nothing"
    assert x[1] == pytest.approx(0.5)
    report = result_report(result)
    shown = report.recommended.x
    np.testing.assert_array_equal(shown, result.X[index], "the value that is shown belongs to the trial's condition")
    assert report.recommended.quality == -((shown[0] - 0.6) ** 2) * (1.0 + shown[1])
    assert coordinates(report, report.recommended).endswith("(drawn)")


def test_surfaces_are_the_model(gm_result, gm_report):
    view = gm_report.surfaces[0]
    corner = np.array([[view.axes[0][7], view.axes[1][50]]])
    mean, std = gm_result.optimizer.predict(corner)
    assert view.mean[7, 50] == pytest.approx(mean[0], rel=1e-9)
    assert view.std[7, 50] == pytest.approx(std[0], rel=1e-6)
    average = averaged(gm_result.optimizer, corner[0], (0.1, 0.1))
    assert view.robust_mean[7, 50] == pytest.approx(average, abs=0.01 * np.ptp(view.robust_mean))


def test_no_hills_are_drawn_that_the_average_does_not_have():
    """Beside a spike three sigma points draw two hills and a peak, a tenth of all values too high."""
    box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.03)

    def spike(x):
        return 1.5 * np.exp(-0.5 * ((x[0] - 0.2) / 0.01) ** 2) + np.exp(-0.5 * ((x[0] - 0.7) / 0.1) ** 2)

    optimizer = sh.Optimizer(box, input_noise=noise, seed=0)
    for x in [*np.linspace(0.0, 1.0, 11), 0.185, 0.192, 0.208, 0.215]:
        optimizer.tell([x], spike([x]))
    view = surfaces_of(optimizer, noise, [optimizer.recommend().x])[0]
    expected = [averaged(optimizer, np.array([x]), (0.03,)) for x in view.axes[0][::10]]
    assert view.robust_mean[::10] == pytest.approx(expected, abs=0.01 * np.ptp(view.mean))
    (drawn,) = [line for line in optimizer.plot_slice().axes[0].lines if "averaged" in str(line.get_label())]
    expected = [averaged(optimizer, np.array([x]), (0.03,)) for x in drawn.get_xdata()[::20]]
    assert drawn.get_ydata()[::20] == pytest.approx(expected, abs=0.01 * np.ptp(view.mean))


def test_three_variables_show_the_two_that_matter():
    box = sh.Box({"idle": (0.0, 1.0), "a": (-2.0, 2.0), "b": (0.0, 4.0)})
    wide = np.diag([100.0, 1.0, 1.0])
    p = GaussianBumps("bump", box, [1.0], [[0.5, 0.0, 2.0]], [wide])
    noise = sh.InputNoise.unit(0.05)
    result = sh.maximize(p, box, 26, input_noise=noise, n_initial=20, seed=0)
    x = result.recommendation.x
    view, close = surfaces_of(result.optimizer, noise, [x])
    assert view.variables == (1, 2)
    assert "a and b" in view.note
    assert view.axes[0][0] == -2.0
    point = [[x[0], view.axes[0][10], view.axes[1][30]]]
    assert view.mean[10, 30] == pytest.approx(result.optimizer.predict(point)[0][0], rel=1e-9)
    for axis, k in zip(close.axes, close.variables, strict=True):  # five standard deviations to each side, in the box
        sides = np.clip(x[k] + np.array([-0.25, 0.25]) * box.widths[k], box.lower[k], box.upper[k])
        assert [axis[0], axis[-1]] == pytest.approx(sides)


def test_failed_trials_leave_holes():
    box = sh.Box({"x": (0.0, 1.0)})

    def shaky(x):
        if x[0] > 0.6:
            raise RuntimeError("dropped")
        return float(x[0])

    result = sh.maximize(shaky, box, 10, n_initial=6, seed=1)
    (label,) = gather.answers(result) or [None]
    score = robust_score(sh.problems.Function(shaky, box), result.X[result.best_index], sh.InputNoise.unit(0.05))
    report = gather.report_of(
        result,
        [gather.candidate(result, label, result.best_index, score)],
        title="t",
        settings={},
        noise=None,
    )
    assert report.failed.any()
    assert report.best_trace[-1] == np.nanmax(report.y)
    assert report.robust_trace is None
    assert report.noise is None
    with pytest.raises(InputError, match="no variable"):
        gather.report_of(result, report.candidates, title="t", settings={}, noise=None, units={"y": "m"})


def test_varying_noise_is_taken_at_the_point_shown():
    """Noise that is 0.1 at x = 0 and 0.01 at x = 1: the ring and the averaged model must follow it."""
    box = sh.Box({"x": (0.0, 1.0), "y": (-1.0, 1.0)})
    noise = sh.InputNoise.varying(lambda x: {"x": 0.1 - 0.09 * x[0], "y": 0.02})
    result = sh.maximize(lambda x: float(np.sin(9.0 * x[0])), box, n_trials=14, n_initial=12, input_noise=noise, seed=0)
    shown = [gather.candidate(result, label, i, None) for label, i in (("highest observed", 0), ("recommended", 1))]
    report = gather.report_of(result, shown, title="t", settings={}, noise=noise)
    for candidate in report.candidates:
        expected = np.diag([0.1 - 0.09 * candidate.x[0], 0.02]) ** 2
        assert candidate.noise == pytest.approx(expected, rel=1e-9)
    assert report.noise is report.candidates[1].noise
    surface = report.surfaces[0]
    i, j = 10, 40
    place = np.array([surface.axes[0][i], surface.axes[1][j]])
    d = (0.1 - 0.09 * place[0], 0.02)
    expected = averaged(result.optimizer, place, d)
    assert surface.robust_mean[i, j] == pytest.approx(expected, abs=0.01 * np.ptp(surface.mean))


def test_a_minimizing_run_in_the_users_sign():
    box = sh.Box({"x": (0.0, 1.0)})
    noise = sh.InputNoise.unit(0.05)

    def cost(x):
        return float((x[0] - 0.3) ** 2 + 5.0)

    result = sh.minimize(cost, box, 12, n_initial=6, seed=0, input_noise=noise)
    labels = gather.answers(result)
    report = gather.report_of(
        result,
        [gather.candidate(result, label, index, None) for label, index in labels.items()],
        title="cost",
        settings={},
        noise=noise,
    )
    assert report.minimized
    assert np.array_equal(report.best_trace, np.minimum.accumulate(result.y))
    at = int(np.argmin(np.abs(report.surfaces[0].axes[0] - 0.5)))
    assert report.surfaces[0].mean[at] == pytest.approx(cost(report.surfaces[0].axes[0][[at]]), abs=0.05)
    assert report.robust_trace[-1] == result.recommendation.mean > 5.0


def test_outliers_are_named_in_the_notes():
    box = sh.Box({"x": (0.0, 1.0)})

    def wild(x):
        return -30.0 if 0.45 < x[0] < 0.55 else float(np.sin(3.0 * x[0]))

    result = sh.maximize(wild, box, 12, n_initial=10, seed=0)
    bad = np.flatnonzero(result.y == -30.0).tolist()
    assert bad
    candidates = [gather.candidate(result, label, i, None) for label, i in gather.answers(result).items()]
    report = gather.report_of(result, candidates, title="wild", settings={}, noise=None)
    assert len(report.notes) == 1
    assert f" {', '.join(map(str, bad))} gave" in report.notes[0]


def test_an_answer_whose_executions_leave_the_box_is_said_to_be_one():
    box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise({"x": 0.05})
    result = sh.maximize(lambda x: float(x[0]), box, 10, n_initial=4, input_noise=noise, seed=0)
    assert result.recommendation.outside["x"] > 0.2
    report = result_report(result)
    assert [note for note in report.notes if "along x" in note]
    assert "along x" in result._repr_html_()


@pytest.mark.parametrize("direction", ["maximize", "minimize"])
def test_a_better_trial_that_breaks_a_limit_is_named(direction):
    sign = 1.0 if direction == "maximize" else -1.0
    run = sh.maximize if direction == "maximize" else sh.minimize
    box = sh.Box({"x": (0.0, 1.0)})
    result = run(lambda x: (sign * x[0], {"t": x[0]}), box, 8, n_initial=8, constraints={"t": (None, 0.5)}, seed=0)
    report = result_report(result)
    extreme = "highest" if direction == "maximize" else "lowest"
    assert report.extreme == f"{extreme} feasible"
    assert sign * report.observed.quality == max(x for x in result.X[:, 0] if x <= 0.5)
    assert sign * report.best_trace[-1] == sign * report.observed.quality
    assert any(f"The {extreme} observed trial gave" in note and "missed t by" in note for note in report.notes)
    assert "feasible" in verdict(report).headline


def test_the_answer_is_a_trial_that_gave_a_value_where_another_failed_at_its_place():
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), n_initial=3, seed=0)
    for x, y in ((0.5, None), (0.5, 1.0), (0.2, 0.3)):
        optimizer.tell([x], y, failed=y is None)
    result = Result(optimizer, (), optimizer.recommend(), False)
    assert gather.answers(result) == {"recommended": 1}
