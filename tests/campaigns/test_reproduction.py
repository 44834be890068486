import re
from dataclasses import replace
from pathlib import Path

from surehold import __version__
from surehold.campaigns import reproduction
from surehold.campaigns.plan import MethodSetup
from surehold.campaigns.reproduction import reproduction_text
from surehold.campaigns.runner import run_campaign
from surehold.campaigns.table import PACKED, read_folder
from surehold.optimization.surrogates.named import DEFAULT_SURROGATE

ROOT = Path(__file__).parents[2]


def test_the_document_is_in_step_with_the_results():
    told = (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8")
    assert told == reproduction_text(ROOT / "results"), "run `make reproduction` and commit docs/reproduction.md"


def test_results_are_compact():
    assert sum(path.stat().st_size for path in (ROOT / "results").rglob("*")) < 8e6
    campaigns = [path for path in (ROOT / "results").glob("*/*") if path.parent.name != "benchmarks"]
    assert {path.name for path in campaigns} == {PACKED}


def test_packing_and_writing(tmp_path, monkeypatch, cheap):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").mkdir()
    run_campaign(cheap, tmp_path / "runs/campaigns/cheap", runs=2)
    reproduction.main(["--pack"])
    text = (tmp_path / "docs/reproduction.md").read_text()
    assert "8 of 16 planned runs" in text
    assert "names no surrogate" not in text, "all methods of this plan name theirs"
    assert "| 4 | 2: all |" in text, "unfinished cells are not shown"
    run_campaign(cheap, tmp_path / "results/cheap", runs=3, only=["hill", "UBO"])
    run_campaign(cheap, tmp_path / "results/cheap", runs=3, only=["flat"])
    run_campaign(cheap, tmp_path / "results/cheap", only=["flat", "BO"])
    text = reproduction_text(tmp_path / "results")
    assert "| 4 | 2: BO on hill; 3: UBO |" in text
    run_campaign(cheap, tmp_path / "results/cheap")  # continues from the packed table
    assert len(read_folder(tmp_path / "results/cheap").rows) == 16
    reproduction.main(["--pack"])
    assert [path.name for path in (tmp_path / "results/cheap").iterdir()] == [PACKED]
    text = (tmp_path / "docs/reproduction.md").read_text()
    assert "16 of 16 planned runs" in text
    assert "unfinished" not in text


def test_methods_with_the_default_surrogate_are_named_with_their_version(tmp_path, cheap):
    methods = {"robust": MethodSetup(robust=True), "thesis": MethodSetup(settings={"preset": "thesis"})}
    plan = replace(cheap, methods=methods | {"random": MethodSetup(optimizer="random")})
    run_campaign(plan, tmp_path / "cheap", runs=1, only=["flat", "random"])
    assert "names no surrogate" not in reproduction_text(tmp_path), "runs are stored with the default of their day"
    table = tmp_path / "cheap" / "table.jsonl"
    table.write_text(re.sub(rf',? ?"surrogate": ?"{DEFAULT_SURROGATE}"', "", table.read_text()))  # as 0.1.0 wrote it
    assert f"They are: robust of `cheap` ({__version__})." in reproduction_text(tmp_path)
