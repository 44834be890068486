import csv
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from surehold.campaigns.illustrations import grasp_scenes, illustrations
from surehold.campaigns.plan_file import load_plan
from surehold.campaigns.report import campaign_report, read_campaigns, write_report
from surehold.campaigns.runner import run_campaign
from surehold.errors import InputError
from surehold.problems.synthetic import GF, GM, RKHS


@pytest.fixture(scope="module")
def folders(tmp_path_factory, cheap):
    """The thesis' plans with few trials, and one that is no plan of the thesis."""
    root = tmp_path_factory.mktemp("campaigns")

    def few(name):
        plan = load_plan(name)
        problems = {label: replace(on, trials=on.initial + 2) for label, on in plan.problems.items()}
        return replace(plan, problems=problems)

    run_campaign(few("table-4.1-defaults"), root / "table-4.1-defaults", runs=3, only=["RKHS", "GF"])
    run_campaign(few("table-4.4-defaults"), root / "table-4.4-defaults", runs=2, only=["RKHS"])
    run_campaign(few("table-4.4-grasps"), root / "table-4.4-grasps", runs=1, only=["bottle"])
    run_campaign(cheap, root / "cheap", runs=2)
    return sorted(path for path in root.iterdir())


@pytest.fixture(scope="module")
def page(tmp_path_factory, folders):
    return write_report(folders, tmp_path_factory.mktemp("report"))


def test_the_whole_report(page):
    folder = page.parent
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'(?:src|href)="https?:', text), "the page loads something from the network"
    for word in ("5.3279 ± 0.0642", "no runs", "3 of 100", "1.66 standard errors", "A cheap plan"):
        assert word in text, word
    for number in ("3.1", "3.3", "3.4", "4.1", "4.4", "4.5", "4.7", "4.9", "4.10", "4.12"):
        assert f"Figure {number}" in text, number
    assert text.count("Figure 4.16: ") >= 4  # safe and unsafe answers, each with its worst re-query
    with open(folder / "tables" / "table-4.1-defaults.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 15
    assert rows[0]["published"] == "5.3279 ± 0.0642"
    assert rows[0]["runs"] == "3 of 100"
    assert (folder / "figures" / "table-4.1-defaults-figure-4.5.svg").stat().st_size > 5000
    assert (folder / "figures" / "figure-4.4.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_opens_in_a_browser(page):
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no chromium here")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", "--virtual-time-budget=8000"]
    told = subprocess.run([*command, page.as_uri()], capture_output=True, text=True, timeout=600, check=True)
    assert 'id="scene-chooser"' in told.stdout  # eight grasps to choose from
    assert told.stdout.count("<svg") >= 10
    assert "<canvas" in told.stdout or "shows no 3-D graphics" in told.stdout


def test_reports_are_repeatable(folders):
    assert str(campaign_report(read_campaigns(folders), illustrated=False)) == str(
        campaign_report(read_campaigns(folders), illustrated=False)
    )


def test_the_same_plan_twice_is_refused(folders):
    with pytest.raises(InputError, match="two folders"):
        read_campaigns([folders[0], folders[0]])


@pytest.fixture(scope="module")
def pictures():
    return {picture.name: picture for picture in illustrations()}


def test_illustrations_show_what_they_say(pictures):
    assert list(pictures) == [f"figure-{n}" for n in ("3.1", "3.3", "3.4", "4.1", "4.4", "4.7", "4.9")]
    kernel = pictures["figure-3.1"].panels[0].lines[1]
    r = np.sqrt(5.0) * kernel.x
    assert kernel.y == pytest.approx((1.0 + r + r**2 / 3.0) * np.exp(-r))
    rkhs = pictures["figure-3.4"].panels[0].lines[0]
    assert rkhs.y == pytest.approx(RKHS()(rkhs.x[:, None]))
    gm, gf = (panel.z for panel in pictures["figure-4.1"].panels[1:])
    assert gm[40, 49] == pytest.approx(GM()([0.40, 0.49]))
    assert gf[34, 25] == pytest.approx(GF()([0.34, 0.25]))


def test_the_unscented_example_is_the_lognormal(pictures):
    """Figure 3.3 sends N(0.35, 0.2^2) through exp(3 x), whose mean and deviation are known."""
    caption = pictures["figure-3.3"].caption
    mean = np.exp(3.0 * 0.35 + 0.5 * 0.6**2)
    std = mean * np.sqrt(np.exp(0.6**2) - 1.0)
    numbers = [float(n) for n in re.findall(r"\d+\.\d+", caption)]
    assert numbers[0] == pytest.approx(mean, abs=2e-3)
    assert numbers[1] == pytest.approx(std, abs=2e-2)
    assert abs(numbers[2] - mean) < 0.2 * abs(numbers[4] - mean), "the unscented mean is no better than the linear one"


def test_the_tree_sees_what_the_process_does_not(pictures):
    """Figure 4.4: between samples of the smooth half the treed process is much surer than the plain one."""
    plain, treed = pictures["figure-4.4"].panels

    def width(panel):
        smooth = panel.bands[0].x < 0.6
        return float(np.mean((panel.bands[0].high - panel.bands[0].low)[smooth]))

    assert width(treed) < 0.3 * width(plain)
    assert treed.verticals
    assert not plain.verticals


def test_the_hand_is_open_in_the_scenes_of_the_default_pose():
    scenes = grasp_scenes()
    assert [label.rpartition(" ")[2] for label in scenes] == ["bottle", "mug", "glass", "drill"]
    for scene in scenes.values():
        assert scene.box is not None
        assert len(scene.contacts.points) == 0


def test_runs_beyond_the_plan_and_of_methods_that_it_no_longer_has_are_told_apart(tmp_path, cheap):
    hill = replace(cheap, problems={"hill": cheap.problems["hill"]}, runs=1)
    run_campaign(hill, tmp_path, runs=2)
    one = replace(hill, methods={"BO": hill.methods["BO"]})
    run_campaign(one, tmp_path, runs=2)
    report = campaign_report(read_campaigns([tmp_path]))
    assert report.facts[0] == ("2", "of 2 planned runs")
    assert report.sections[0].tables[0].rows[0][3] == "2 of 2"
    assert [note for note in report.notes if "no longer has" in note] == [
        "A cheap plan: 2 runs of problems or methods that the plan no longer has; not shown."
    ]


def test_re_queries_without_a_value_are_told(tmp_path, cheap):
    run_campaign(cheap, tmp_path, runs=1, only=["hill", "BO"])
    campaigns = read_campaigns([tmp_path])
    (row,) = campaigns["cheap"].done.values()
    row["failed_requeries"] = 7
    (note,) = campaign_report(campaigns).notes
    assert "1 run gave no value in some re-queries (7 at most)" in note
