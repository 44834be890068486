import json
import re
import shutil
import subprocess
import threading
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

import surehold as sh
from surehold.errors import InputError
from surehold.reports.figures import figures
from surehold.reports.files import result_data
from surehold.reports.interactive import interactive_plots
from surehold.reports.page import render, table_rows
from surehold.reports.study_report import study_report
from surehold.studies.dashboard import Dashboard
from surehold.studies.replay import result_of
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

BOX = SearchSpace({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})


def spiked(p):
    spike = 0.9 * np.exp(-0.5 * (((p["dx"] + 0.025) / 0.002) ** 2 + ((p["dy"] - 0.01) / 0.002) ** 2))
    return float(spike + 0.7 * np.exp(-0.5 * (((p["dx"] - 0.01) / 0.02) ** 2 + ((p["dy"] + 0.005) / 0.015) ** 2)))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    settings = StudySettings(BOX, sh.InputNoise({"dx": 0.003, "dy": 0.003}), {"dx": "m", "dy": "m"}, {"n_initial": 10})
    study = RobotStudy.create("mug", settings, str(tmp_path_factory.mktemp("study") / "journal.log"))
    study.add({"dx": -0.0255, "dy": 0.0095}, 0.88)
    for _ in range(24):
        asked = study.ask()
        study.tell(asked.id, spiked(asked.parameters))
    study.veto(study.ask().id, "table")
    study.ask()
    return study


def test_the_replay_is_the_run(study):
    result = result_of(study)
    assert len(result.trials) == 26
    assert result.trials[-1].failure == "table"
    optimizer = sh.Optimizer(BOX.box, input_noise=study.settings.input_noise, n_initial=10)
    for i, trial in enumerate(result.trials):
        optimizer.tell(trial.x, None if trial.failure else trial.y, failed=bool(trial.failure))
        if i in (12, 25):
            assert trial.recommendation.mean == optimizer.recommend().mean
        assert trial.best == np.nanmax(optimizer.y)
    assert np.array_equal(result.recommendation.x, study.sampler.optimizer(study.study).recommend().x)


def test_the_page_says_what_is_recommended(study):
    report = study_report(study)
    assert [c.label for c in report.candidates] == ["highest observed", "recommended"]
    assert report.recommended.predicted_mean == study.recommend().mean
    told = dict(table_rows(report))["model: mean under the noise ± its uncertainty"]
    assert [cell.split(" ± ")[0] for cell in told] == [f"{c.predicted_mean:.4f}" for c in report.candidates]
    page = render(report)
    peak = max(trial.y for trial in result_of(study).trials if not trial.failure)
    assert peak >= 0.88
    assert f"The highest peak ({peak:.3f}) is not recommended: when the input is off, the model expects" in page
    assert "1 trial is still under way" in page
    assert f"trial {report.recommended.trial}, one of" in page


def test_a_study_without_values_has_no_report(tmp_path):
    empty = RobotStudy.create("empty", StudySettings(BOX), str(tmp_path / "j.log"))
    with pytest.raises(InputError, match="no trial with a value yet"):
        study_report(empty)
    empty.tell(empty.ask().id, 0.4)
    assert "The best value found is 0.400." in render(study_report(empty))


def test_all_kinds_of_parameters_are_drawn(tmp_path):
    space = SearchSpace(
        {
            "f": FloatDistribution(0.1, 10.0, log=True),
            "n": IntDistribution(1, 5),
            "c": CategoricalDistribution(["a", "b"]),
        }
    )
    study = RobotStudy.create("all", StudySettings(space, units={"f": "N"}), str(tmp_path / "j.log"))
    for _ in range(8):
        asked = study.ask()
        study.tell(asked.id, asked.parameters["n"] - asked.parameters["f"])
    report = study_report(study)
    assert [v.label for v in report.variables] == ["f [N]", "n"]
    answer = study.recommend().parameters
    rows = dict(table_rows(report))
    assert float(rows["f [N]"][0]) == pytest.approx(answer["f"], rel=1e-3), "the value, not its logarithm"
    taken = [trial.params["c"] for trial in study.trials()]
    assert report.choices == {"c": tuple(taken)}
    assert f", c = {taken[report.recommended.trial]}" in render(report)
    assert report.surfaces[0].variables == (0, 1)
    assert report.surfaces[0].note == "slice through the recommended point over f and n"
    plots = interactive_plots(report)
    assert len(plots) == 2
    drawn = json.loads(plots["surehold-2-model"])
    assert drawn["layout"]["xaxis"]["type"] == "log"
    assert drawn["data"][-1]["x"] == pytest.approx([answer["f"]], rel=1e-4)


def test_choices_alone_have_a_page_without_maps(tmp_path):
    space = SearchSpace({"c": CategoricalDistribution(["a", "b", "c"]), "e": CategoricalDistribution([1, 2])})
    study = RobotStudy.create("choices", StudySettings(space), str(tmp_path / "j.log"))
    for _ in range(10):
        asked = study.ask()
        study.tell(asked.id, float(asked.parameters["e"]))
    report = study_report(study)
    assert report.surfaces == ()
    assert f"c = {report.choices['c'][report.recommended.trial]}, e = 2" in render(report)


def test_interactive_plots_are_plotly_figures(study):
    plots = {name: json.loads(text) for name, text in interactive_plots(study_report(study)).items()}
    assert list(plots) == ["surehold-1-progress", "surehold-2-model", "surehold-3-under-noise"]
    heat, trials, highest, answer = plots["surehold-3-under-noise"]["data"]
    report = study_report(study)
    values = report.surfaces[0].robust_mean
    assert np.allclose(np.array(heat["z"]), values.T, rtol=1e-4)
    assert (len(heat["x"]), len(heat["y"])) == values.shape
    assert np.allclose(trials["x"], report.X[:, 0] * 1000.0, rtol=1e-4)
    assert answer["x"] == pytest.approx([report.recommended.x[0] * 1000.0], rel=1e-4)
    assert highest["name"] == "highest observed"
    progress = plots["surehold-1-progress"]["data"]
    assert [line["name"] for line in progress] == ["trial", "highest observed", "recommended, expected under the noise"]
    assert progress[0]["y"][-1] is None  # the vetoed trial


@pytest.fixture
def dashboard(study):
    """The address of the study's page in a running dashboard."""
    board = Dashboard(study, lambda study: interactive_plots(study_report(study)), pause=0.2)
    assert board.update()
    assert not board.update()
    ready = threading.Event()
    found = []
    thread = threading.Thread(target=board.serve, args=("127.0.0.1", 0, lambda a: (found.append(a), ready.set())))
    thread.start()
    assert ready.wait(60.0)
    yield found[0]
    board.close()
    thread.join(timeout=600)
    assert not thread.is_alive()


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_the_dashboard_shows_our_plots_and_note(study, dashboard):
    before = Path(study.storage.url).read_bytes()
    address = re.sub(r"/dashboard/(studies/\d+)", r"/api/\1", dashboard)
    with urllib.request.urlopen(address, timeout=600) as answer:
        shown = json.load(answer)
    assert {plot["id"] for plot in shown["plotly_graph_objects"]} == {
        "surehold-1-progress", "surehold-2-model", "surehold-3-under-noise",
    }  # fmt: skip
    for plot in shown["plotly_graph_objects"]:
        assert json.loads(plot["graph_object"])["data"]
    assert "Recommended for mug" in shown["note"]["body"]
    assert len(shown["trials"]) == 27
    assert Path(study.storage.url).read_bytes() == before, "looking must not write into the study"


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_browser_draws_the_dashboard(dashboard, tmp_path):
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
    flags += [
        "--disable-background-networking",
        "--disable-component-update",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    run = subprocess.run(
        ["chromium", *flags, "--virtual-time-budget=15000", "--dump-dom", dashboard],
        capture_output=True, text=True, timeout=600, check=True,
    )  # fmt: skip
    for title in ("Highest observed and robust value", "Model averaged over the input noise"):
        assert title in run.stdout, "the plot was not drawn"


def test_trials_are_shown_where_they_were_and_the_best_of_all_may_be_no_answer(tmp_path):
    """The trial of the answer was commanded far from there, and a better one reached a place outside of the box."""
    settings = StudySettings(SearchSpace({"x": (0.0, 1.0)}), None, {}, {"n_initial": 3})
    study = RobotStudy.create("astray", settings, str(tmp_path / "j.log"))
    for x, reached in ((0.2, 0.9), (0.88, 0.4), (0.6, 0.5), (0.95, 1.1)):
        study.add({"x": x}, reached, reached={"x": reached})
    report = study_report(study)
    assert study.recommend().trial == report.recommended.trial == 0
    assert report.recommended.x == pytest.approx([0.9])
    assert report.recommended.quality == 0.9
    assert report.X[:, 0] == pytest.approx([0.9, 0.4, 0.5, 1.1])
    assert report.best_trace == pytest.approx([0.9, 0.9, 0.9, 0.9])
    page = render(report)
    assert "The best feasible value found is 0.900" in page
    assert "The highest observed trial gave 1.1, but reached a place outside of the box." in page
    assert "highest observed<" not in page


def test_a_study_that_began_where_nothing_is_allowed_has_a_report(tmp_path):
    settings = StudySettings(SearchSpace({"x": (0.0, 1.0)}), None, {}, {"n_initial": 1, "allowed": ["x <= 0.5"]})
    study = RobotStudy.create("began", settings, str(tmp_path / "j.log"))
    study.add({"x": 0.9}, 2.0)
    with pytest.raises(InputError, match="no trial at an allowed input"):
        study_report(study)
    study.add({"x": 0.4}, 1.0)
    report = study_report(study)
    assert report.recommended.quality == 1.0
    assert "The highest observed trial gave 2, but is not allowed." in report.notes


def test_trials_are_called_by_their_ids(tmp_path):
    """One whose worker died has told nothing: the places of the others and their ids are not the same."""
    settings = StudySettings(SearchSpace({"x": (0.0, 1.0)}), None, {}, {"n_initial": 3})
    study = RobotStudy.create("ids", settings, str(tmp_path / "j.log"))
    study.add({"x": 0.1}, 0.1)
    dead = study.ask(worker="dead")
    for x, y in ((0.3, 0.2), (0.5, 0.9), (0.7, 0.3), (0.52, 0.85)):
        study.add({"x": x}, y)
    report, answer = study_report(study), study.recommend()
    assert dead.id == 1
    assert report.numbers.tolist() == [0, 2, 3, 4, 5]
    assert dict(table_rows(report))["trial, from 0"][-1] == str(answer.trial)
    data = result_data(report)
    assert data["trials"]["number"] == [0, 2, 3, 4, 5]
    assert data["candidates"][-1]["trial"] == answer.trial
    page = render(report)
    assert f"(trial {answer.trial}, one of 5)" in page
    assert "Trials have the ids of the study; those that are missing have told nothing." in page
    assert '<td class="n">5</td>' in page
    assert json.loads(interactive_plots(report)["surehold-1-progress"])["data"][0]["x"] == [0, 2, 3, 4, 5]
    drawn = figures(report)["trace"].axes[0]
    assert drawn.collections[0].get_offsets()[:, 0].tolist() == [0, 2, 3, 4, 5]
