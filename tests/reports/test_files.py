import json

import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.reports import files
from surehold.reports.glossary import glossary
from surehold.reports.plots import result_report


def test_a_run_is_written_and_read_back(gm_report, tmp_path):
    page = files.write_run(gm_report, tmp_path / "a" / "b")
    assert page == tmp_path / "a" / "b" / "report.html"
    names = sorted(p.name for p in page.parent.iterdir())
    assert names == ["figures", "report.html", "result.json"], "and no temporary file"
    pictures = sorted(p.name for p in (page.parent / "figures").iterdir())
    assert len(pictures) == 12
    assert {p.rpartition(".")[2] for p in pictures} == {"svg", "png"}
    data = json.loads((page.parent / "result.json").read_text())
    np.testing.assert_array_equal(data["trials"]["x"], gm_report.X)
    np.testing.assert_array_equal(data["trials"]["y"], gm_report.y)
    assert [c["label"] for c in data["candidates"]] == ["highest observed", "recommended"]
    assert data["candidates"][1]["mean"] == gm_report.recommended.mean
    np.testing.assert_array_equal(data["candidates"][1]["requeries"]["values"], gm_report.recommended.values)
    assert data["robust"][0] is None, "no recommendation during the initial design"


def test_writing_again_replaces(rkhs_report, tmp_path):
    (tmp_path / "report.html").write_text("old")
    (tmp_path / "mine.txt").write_text("keep")
    files.write_run(rkhs_report, tmp_path)
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_unwritable_places(rkhs_report, tmp_path):
    (tmp_path / "taken").write_text("a file")
    for place in (tmp_path / "taken", tmp_path / "taken" / "below", "/proc/nowhere"):
        with pytest.raises(InputError, match="cannot be written"):
            files.write_run(rkhs_report, place)
    assert (tmp_path / "taken").read_text() == "a file"


def test_inputs_are_written_in_the_users_units_and_further_outputs_with_them(tmp_path):
    box = sh.Box({"force": (0.1, 100.0, "log"), "fingers": (2, 5, "int"), "grip": ["pinch", "power"]})

    def trial(p):
        told = -(np.log10(p["force"]) ** 2) - (p["fingers"] - 3) ** 2 + (p["grip"] == "power")
        return float(told), {"torque": 2.0 * p["force"], "note": p["grip"]}

    noise = sh.InputNoise({"force": 0.1, "fingers": 0.0})
    result = sh.maximize(trial, box, 8, constraints={"torque": (None, 20.0)}, input_noise=noise, seed=0)
    page = result.report(tmp_path, lambda p: trial(p)[0])
    data = json.loads((tmp_path / "result.json").read_text())
    trials, answer = data["trials"], data["candidates"][-1]
    assert [one["grip"] for one in trials["parameters"]] == [one.parameters["grip"] for one in result.trials]
    forces = [one["force"] for one in trials["parameters"]]
    assert trials["outputs"]["torque"] == pytest.approx([2.0 * force for force in forces])
    assert np.exp([x[0] for x in trials["x"]]) == pytest.approx(forces)
    assert trials["feasible"] == result.optimizer.feasible.tolist() != [True] * 8
    assert answer["parameters"] == trials["parameters"][answer["trial"]]
    assert {len(point) for point in answer["requeries"]["points"]} == {len(answer["x"])} == {len(data["variables"])}
    text = page.read_text(encoding="utf-8")
    assert '<th class="n" scope="col">torque</th><th class="n" scope="col">note</th>' in text
    assert text.count("not feasible</td>") == trials["feasible"].count(False)
    assert "feasible" in dict(glossary(result_report(result)))
