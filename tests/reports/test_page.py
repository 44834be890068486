import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from surehold.reports.page import render

VOID = {"meta", "br", "input", "hr", "img", "link"}


class Reader(HTMLParser):
    """Collects text and elements, and checks that elements nest."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.text, self.scripts = [], [], [], []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        (self.scripts if self.open and self.open[-1] in ("script", "style") else self.text).append(data)

    def words(self):
        return re.sub(r"\s+", " ", "".join(self.text))


@pytest.fixture(scope="module")
def gm_page(gm_report):
    return render(gm_report)


def test_the_page_says_what_happened(gm_report, gm_page):
    words = Reader(gm_page).words()
    assert "was refused" in words
    assert "Highest observed refused" in words
    assert "Recommended holds" in words
    assert f"{gm_report.observed.mean:.4f}" in words
    assert f"{gm_report.recommended.mean:.4f}" in words
    assert "seed 1" in words
    assert "Averaged over the input noise" in words
    assert words.count("initial") >= 8


def test_the_page_needs_nothing_from_outside(gm_page):
    reader = Reader(gm_page)
    for tag, attributes in reader.elements:
        for name in ("src", "href", "xlink:href", "data", "action", "srcset"):
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:")), f"<{tag} {name}={value[:60]}>"
        assert tag not in ("link", "iframe", "object", "embed")
    styles = re.findall(r"<style>(.*?)</style>", gm_page, flags=re.DOTALL)
    assert not any("@import" in style or "http" in style for style in styles)


def test_identifiers_are_unique(gm_page):
    identifiers = [a["id"] for _, a in Reader(gm_page).elements if "id" in a]
    assert len(identifiers) == len(set(identifiers))


def test_the_scene_is_there_and_can_be_left_out(gm_page, rkhs_report):
    text = re.search(r'<script type="application/json" id="scene-data">(.*?)</script>', gm_page, flags=re.DOTALL)[1]
    data = json.loads(text)
    assert [v["label"] for v in data["views"]] == ["highest observed", "recommended"]
    assert "4 contacts" in data["views"][0]["note"]
    assert "Permission is hereby granted" in gm_page, "the license travels with the library"
    plain = render(rkhs_report)
    assert "three.js" not in plain
    assert "scene-data" not in plain
    assert len(plain) < 700_000
    Reader(plain)


def test_user_text_is_escaped(gm_report):
    evil = "</script><img src=x onerror=alert(1)>&\"'"
    candidates = tuple(replace(c, pose=evil, status=evil, details={evil: evil}) for c in gm_report.candidates)
    meshes = tuple(replace(m, name=evil) for m in gm_report.observed.scene.meshes)
    candidates = (replace(candidates[0], scene=replace(candidates[0].scene, meshes=meshes)), *candidates[1:])
    variables = (replace(gm_report.variables[0], name=evil), replace(gm_report.variables[1], name="$x_{$"))
    page = render(
        replace(
            gm_report,
            title=evil,
            settings={evil: evil},
            candidates=candidates,
            variables=variables,
            quality_name=evil,
            disturbance=evil,
            notes=(evil,),
        )
    )
    reader = Reader(page)
    assert not any(tag == "img" or "onerror" in attributes for tag, attributes in reader.elements)
    assert sum(tag == "script" for tag, _ in reader.elements) == 4
    assert "$x_{$" in reader.words()


def test_interrupted_and_failed_trials(rkhs_report):
    y = rkhs_report.y.copy()
    y[[0, 3]] = np.nan
    page = render(replace(rkhs_report, y=y, interrupted=True, planned_trials=99))
    words = Reader(page).words()
    assert f"interrupted after {y.size} of 99 trials" in words
    assert "2 failed" in words


def test_equal_reports_give_equal_pages(rkhs_report):
    assert render(rkhs_report) == render(rkhs_report)


def in_a_browser(page, folder):
    """Return the page as headless Chromium has it after its scripts."""
    (folder / "page.html").write_text(page, encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"]
    flags += ["--disable-background-networking", "--disable-sync", f"--user-data-dir={folder / 'profile'}"]
    return subprocess.run(
        ["chromium", *flags, "--virtual-time-budget=3000", "--dump-dom", f"file://{folder / 'page.html'}"],
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    ).stdout


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_browser_draws_the_scene(gm_page, tmp_path):
    dom = in_a_browser(gm_page, tmp_path)
    assert re.search(r'<canvas[^>]*aria-label="3-D view of the grasp: recommended', dom)
    assert re.search(r'data-view="1" aria-pressed="true"', dom)


HAND = """<script>
const mark = document.querySelector("#trace-trials-told use");
mark.dispatchEvent(new PointerEvent("pointermove", {bubbles: true}));
const figure = mark.closest("svg"), box = figure.getBoundingClientRect();
const middle = {clientX: box.left + box.width / 2, clientY: box.top + box.height / 2};
figure.dispatchEvent(new MouseEvent("dblclick", middle));
</script>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_figures_can_be_pointed_at_and_looked_at_closely(gm_page, gm_report, tmp_path):
    whole = re.search(r'aria-label="Best and robust value by trial"[^>]*viewBox="([^"]*)"', gm_page)[1]
    dom = in_a_browser(gm_page.replace("</body>", HAND + "</body>"), tmp_path)
    tip = re.search(r'<div class="tip"[^>]*>(.*?)</div>', dom, flags=re.DOTALL)
    assert tip[1].startswith(f"trial 0: {gm_report.quality_name} ")
    assert "hidden" not in tip[0]
    closer = re.search(r'aria-label="Best and robust value by trial"[^>]*viewBox="([^"]*)"', dom)[1]
    *_, width, height = (float(number) for number in whole.split())
    expected = [width / 4, height / 4, width / 2, height / 2]
    assert [float(number) for number in closer.split()] == pytest.approx(expected, abs=1.0)  # events know whole pixels


@pytest.mark.parametrize(
    ("deviations", "normal", "said"),
    [
        ((0.1, 0.1), True, "ring: two standard deviations of the input noise, where about 86 % of"),
        ((0.1, 0.1), False, "ring: two standard deviations of the input noise</li>"),
        ((0.1, 0.0), True, "line: two standard deviations of the input noise to each side, where about 95 % of"),
    ],
)
def test_what_lies_within_two_deviations_is_said_of_normal_noise_only(gm_report, deviations, normal, said):
    covariance = np.diag(np.square(deviations))
    both = tuple(replace(c, noise=covariance) for c in gm_report.candidates)
    assert said in render(replace(gm_report, candidates=both, normal_noise=normal))
    drawn = np.random.default_rng(0).standard_normal((100_000, 2))
    within = {2: np.hypot(*drawn.T) < 2.0, 1: abs(drawn[:, 0]) < 2.0}[np.count_nonzero(deviations)]
    assert f"{100.0 * within.mean():.0f} %" in said or not normal


def test_the_line_of_one_variable_is_explained_below_its_figure(rkhs_report):
    line = "line: two standard deviations of the input noise to each side"
    noisy = tuple(replace(c, noise=np.eye(1) * 1e-4) for c in rkhs_report.candidates)
    assert line in render(replace(rkhs_report, candidates=noisy, normal_noise=True))
    exact = tuple(replace(c, noise=None) for c in rkhs_report.candidates)
    assert line not in render(replace(rkhs_report, candidates=exact))


def test_a_ring_is_no_line_because_of_its_units(gm_report):
    scale, variables = np.array([1e-12, 1e9]), gm_report.variables
    others = [replace(v, lower=v.lower * s, upper=v.upper * s) for v, s in zip(variables, scale, strict=True)]
    both = [replace(c, x=c.x * scale, noise=np.diag((0.1 * scale) ** 2)) for c in gm_report.candidates]
    axes = tuple(axis * s for axis, s in zip(gm_report.surfaces[0].axes, scale, strict=True))
    views = (replace(gm_report.surfaces[0], axes=axes),)
    changed = {"variables": tuple(others), "candidates": tuple(both), "X": gm_report.X * scale, "surfaces": views}
    assert "ring: two standard deviations" in render(replace(gm_report, normal_noise=True, **changed))
