from dataclasses import replace

import numpy as np

import surehold as sh
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
