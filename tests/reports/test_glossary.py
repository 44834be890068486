from dataclasses import replace

import numpy as np
import pytest

import surehold as sh
from surehold.choices import QUALITIES
from surehold.reports.glossary import glossary
from surehold.reports.page import table_rows
from surehold.reports.plots import result_report


def test_the_words_are_those_of_the_page(gm_report):
    words = dict(glossary(gm_report))
    assert {"trial", "re-queries", "averaged over the input noise"} <= words.keys()
    assert not any("epsilon" in word for word in words)
    names = " ".join(name for name, _ in table_rows(gm_report))
    for word in ("95 % of them are better than", "mean under the noise", "one execution", "hit exactly"):
        assert word in words
        assert word in names


def test_a_grasp_has_its_words(gm_report):
    settings = {"quality": "epsilon", "contact": "graded"}
    words = dict(glossary(replace(gm_report, settings=settings)))
    assert {"quality (epsilon)", "graded contacts", "below 0"} <= words.keys()


def test_every_quality_is_explained(gm_report):
    for quality in QUALITIES:
        assert f"quality ({quality})" in dict(glossary(replace(gm_report, settings={"quality": quality})))
    held = dict(glossary(replace(gm_report, settings={"quality": "epsilon"}, counted=True)))
    assert not {"quality (epsilon)", "below 0"} & held.keys(), "the page of successes shows no quality"


def test_below_0_is_no_collision_where_the_quality_is_signed(gm_report):
    below = {
        quality: dict(glossary(replace(gm_report, settings={"quality": quality})))["below 0"]
        for quality in ("epsilon", "signed_epsilon")
    }
    assert below["epsilon"].startswith("The open hand overlapped")
    assert below["signed_epsilon"].startswith("Some push is not resisted")


@pytest.mark.parametrize(
    ("hand", "preshape", "thumb"),
    [("icub-left", "pinch", True), ("icub-right", "new.yaml", False), ("jaws", "pinch", False)],
)
def test_the_posture_is_said_to_turn_the_thumb_only_where_it_does(gm_report, hand, preshape, thumb):
    posed = tuple(replace(c, pose="palm at 0, s1 = 0.40 rad") for c in gm_report.candidates)
    settings = {"hand": hand, "preshape": preshape}
    assert ("turns the thumb" in dict(glossary(replace(gm_report, settings=settings, candidates=posed)))["s1"]) == thumb


def test_words_that_are_not_on_the_page_are_not_explained(gm_report):
    unasked = tuple(
        replace(c, values=np.empty(0), predicted_mean=None, predicted_std=None) for c in gm_report.candidates
    )
    words = dict(glossary(replace(gm_report, candidates=unasked)))
    assert "input noise" in words
    assert not {"re-queries", "95 % of them are better than", "mean under the noise", "one execution"} & words.keys()
    counted = dict(glossary(replace(gm_report, counted=True)))
    assert "re-queries" in counted
    assert not {"95 % of them are better than", "one execution"} & counted.keys()


def test_conditions_that_nobody_sets_have_their_words():
    box = sh.Box({"grip": (0.0, 1.0)}, uncontrolled={"payload": [0.2, 0.3, 0.8]})

    def quality(x):
        return 1.0 - (x[0] - x[1]) ** 2

    words = dict(glossary(result_report(sh.maximize(quality, box, 8, seed=0), quality)))
    assert "drawn anew" in words["re-queries"]
    assert {"mean under the noise", "one execution"} <= words.keys()
    assert "input noise" not in words
