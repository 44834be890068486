import json

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.reports import files


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
