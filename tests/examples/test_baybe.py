"""The recommender example in BayBE's own campaign."""

import importlib.util
from pathlib import Path

import pytest

import surehold as sh

pytest.importorskip("baybe")


@pytest.mark.filterwarnings("ignore")  # of BayBE and what it imports
def test_the_campaign_of_baybe_ends_with_what_holds():
    path = Path(__file__).parents[2] / "examples/baybe_recommender.py"
    spec = importlib.util.spec_from_file_location("baybe_recommender", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    answer, highest = example.campaign(50)
    f, noise = sh.problems.GM(), sh.InputNoise.unit(0.1)
    best = sh.problems.robust_optimum(f, noise).x
    held, spike, most = (sh.problems.robust_score(f, x, noise, n=2000, seed=1).mean for x in (answer.x, highest, best))
    assert held > 0.9 * most
    assert held > spike
