from surehold.reports.glossary import glossary
from surehold.reports.page import table_rows


def test_the_words_are_those_of_the_page(gm_report):
    words = dict(glossary(gm_report))
    assert {"trial", "re-queries", "unscented mean"} <= words.keys()
    assert not any("epsilon" in word for word in words)
    names = " ".join(name for name, _ in table_rows(gm_report))
    for word in ("95 % of them are better than", "mean under the noise", "one execution", "hit exactly"):
        assert word in words
        assert word in names


def test_a_grasp_has_its_words(gm_report):
    from dataclasses import replace

    settings = {"quality": "epsilon", "contact": "graded"}
    words = dict(glossary(replace(gm_report, settings=settings)))
    assert {"quality (epsilon)", "graded contacts", "below 0"} <= words.keys()
