import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

from surehold.reports import figures
from surehold.reports.drawing import PALETTE, marked
from surehold.reports.page import render


def test_every_figure_is_drawn(gm_report, rkhs_report):
    names = {"overview", "trace", "shake_highest_observed", "shake_recommended", "surface_mean", "surface_averaged"}
    assert set(figures.figures(gm_report)) == names
    drawn = set(figures.figures(rkhs_report))
    assert {"overview", "trace", "surface", "shake_recommended"} <= drawn


def test_files_are_valid_and_repeatable(rkhs_report):
    figure = figures.trace(rkhs_report)
    text = figures.svg_text(figure, "trace")
    ElementTree.fromstring(figures.on_white(text))
    root = ElementTree.fromstring(text)
    assert root.tag.endswith("svg")
    again = figures.trace(rkhs_report)
    assert text == figures.svg_text(again, "trace")
    assert "highest value so far" in text, "text stays text"
    png = figures.png_bytes(figure)
    assert png.startswith(b"\x89PNG")
    assert png == figures.png_bytes(again)


def test_inline_figures_follow_the_page(gm_report):
    drawing = figures.svg_text(figures.shake(gm_report, gm_report.observed), "shake")
    text = figures.inline_svg(drawing, "shake", 'what "shaking" does')
    root = ElementTree.fromstring(text)
    assert "width" not in root.attrib
    assert root.attrib["aria-label"] == 'what "shaking" does'
    assert "var(--ink)" in text
    assert "var(--high)" in text
    assert not any(color in text for color in PALETTE.values())


def test_marks_say_which_trial_they_are(gm_report):
    titles = [f"trial {i} & <b>" for i in range(gm_report.y.size)]
    drawing = figures.svg_text(figures.trace(gm_report), "trace")
    root = ElementTree.fromstring(figures.inline_svg(drawing, "trace", "trace", {"trials-told": titles}))
    svg = "{http://www.w3.org/2000/svg}"
    group = next(g for g in root.iter(f"{svg}g") if g.get("id") == "trace-trials-told")
    marks = list(group.iter(f"{svg}use"))
    assert [mark.find(f"{svg}title").text for mark in marks] == titles
    assert np.all(np.diff([float(mark.get("x")) for mark in marks]) > 0.0), "trials from left to right"
    assert len(list(root.iter(f"{svg}title"))) == len(titles)


def test_marks_of_few_trials_are_found_too(rkhs_report):
    traces = {"best_trace": rkhs_report.best_trace[:2], "robust_trace": None}
    few = replace(rkhs_report, X=rkhs_report.X[:2], y=rkhs_report.y[:2], **traces)
    drawing = figures.svg_text(figures.trace(few), "trace")
    assert figures.inline_svg(drawing, "trace", "", {"trials-told": ["first", "second"]}).count("<title>") == 2
    assert "<title>" not in figures.inline_svg(drawing, "trace", "", {"trials-told": []}), "a stray mark has no trial"


def test_the_histogram_counts_every_query(gm_report):
    for candidate in gm_report.candidates:
        axes = figures.shake(gm_report, candidate).axes[0]
        assert sum(bar.get_height() for bar in axes.patches) == candidate.values.size
    left, right = (figures.shake(gm_report, c).axes[0] for c in gm_report.candidates)
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()


def test_both_maps_share_their_color_scale(gm_report):
    view = gm_report.surfaces[0]
    limits = [figures.surface(gm_report, view, robust).axes[0].images[0].get_clim() for robust in (False, True)]
    assert limits[0] == limits[1]
    assert limits[0][1] >= max(view.mean.max(), view.robust_mean.max())


def test_the_map_is_not_transposed(gm_report):
    view = gm_report.surfaces[0]
    slope = np.add.outer(view.axes[0], 0.0 * view.axes[1])  # grows with the first variable only
    image = figures.surface(gm_report, replace(view, mean=slope), False).axes[0].images[0]
    shown = np.asarray(image.get_array())
    assert np.all(np.diff(shown, axis=1) > 0)
    assert np.all(np.diff(shown, axis=0) == 0)


def test_constant_outcomes_and_awkward_names(rkhs_report):
    flat = replace(
        rkhs_report,
        y=np.zeros(rkhs_report.y.size),
        best_trace=np.zeros(rkhs_report.y.size),
        candidates=tuple(replace(c, quality=0.0, values=np.zeros(5)) for c in rkhs_report.candidates),
        surfaces=tuple(
            replace(s, mean=0 * s.mean, robust_mean=0 * s.robust_mean, std=0 * s.std) for s in rkhs_report.surfaces
        ),
        variables=tuple(replace(v, name="$\\frac{a}") for v in rkhs_report.variables),
        quality_name="$ <&>",
    )
    for name, figure in figures.figures(flat).items():
        ElementTree.fromstring(figures.svg_text(figure, name))


def test_a_map_that_is_flat_but_for_rounding_is_drawn_flat(gm_report):
    bent = np.linspace(0.3, np.nextafter(np.nextafter(0.3, 1.0), 1.0), gm_report.surfaces[0].mean.size)
    level = bent.reshape(gm_report.surfaces[0].mean.shape)
    flat = replace(gm_report, surfaces=(replace(gm_report.surfaces[0], mean=level, robust_mean=level),))
    images = [image for figure in figures.figures(flat).values() for axes in figure.axes for image in axes.images]
    assert len(images) >= 2
    assert all(image.norm.vmax - image.norm.vmin > 0.01 for image in images), "rounding does not fill the colors"


def test_all_failed_but_one(gm_report):
    y = np.full(gm_report.y.size, np.nan)
    y[-1] = 1.0
    best = np.full(y.size, np.nan)
    best[-1] = 1.0
    for figure in figures.figures(replace(gm_report, y=y, best_trace=best)).values():
        assert figures.png_bytes(figure)


def test_trials_that_did_not_succeed_are_crossed(gm_report):
    y = np.arange(gm_report.y.size) % 3 / 2.0  # 0, 1/2 and 1 of two executions
    y[4] = np.nan
    counted = replace(gm_report, y=y, counted=True)
    marks = marked(counted)
    assert np.array_equal(np.flatnonzero(marks["trials-failed"]), np.flatnonzero(~(y >= 0.5)))
    assert not np.any(marks["trials-failed"] & (marks["trials-initial"] | marks["trials-later"]))
    (cross,) = (
        c for c in figures.figures(counted)["surface_mean"].axes[0].collections if c.get_gid() == "trials-failed"
    )
    assert len(cross.get_offsets()) == marked(counted, counted.surfaces[0])["trials-failed"].sum()
    assert "did not succeed</li>" in render(counted)
    assert "failed trial</li>" in render(replace(gm_report, y=np.where(marks["trials-failed"], np.nan, gm_report.y)))
    assert "</span> failed trial</li>" not in render(gm_report)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.9])
def test_the_name_of_the_initial_design_lies_in_the_figure(rkhs_report, share):
    figure = figures.figures(replace(rkhs_report, n_initial=round(share * rkhs_report.y.size)))["trace"]
    axes = figure.axes[0]
    figure.draw_without_rendering()
    (name,) = [text for text in axes.texts if text.get_text() == "initial design"]
    box, frame = name.get_window_extent(), axes.get_window_extent()
    assert frame.x0 <= box.x0
    assert box.x1 <= frame.x1


def test_a_single_trial_is_number_0(rkhs_report):
    one = replace(
        rkhs_report,
        X=rkhs_report.X[:1],
        y=rkhs_report.y[:1],
        best_trace=rkhs_report.y[:1],
        robust_trace=None,
        candidates=(replace(rkhs_report.recommended, trial=0, values=np.array([1.0])),),
    )
    axes = figures.trace(one).axes[0]
    assert [tick for tick in axes.get_xticks() if -0.5 <= tick <= 0.5] == [0.0]
    assert {float(tick) % 1.0 for tick in axes.get_xticks()} == {0.0}
    page = render(one)
    assert "<b>1</b> trial (1 initial)" in page
    nearly = replace(one, y=np.array([1e-9]), best_trace=np.array([1e-9]), robust_trace=np.array([1e-9 * (1 + 4e-16)]))
    axes = figures.trace(nearly).axes[0]
    low, high = axes.get_ylim()
    assert sum(low <= tick <= high for tick in axes.get_yticks()) >= 3, "an axis with numbers"
    assert [line.get_marker() for line in axes.lines if "recommended" in str(line.get_label())] == ["o"]
    assert "<summary>The only trial</summary>" in page


@pytest.mark.parametrize("values", [np.ones(100), np.zeros(100), np.arange(100) % 2.0])
def test_shares_are_drawn_from_0_to_1(rkhs_report, values):
    counted = replace(
        rkhs_report,
        y=np.round(np.clip(rkhs_report.y, 0.0, 1.0)),
        counted=True,
        candidates=(replace(rkhs_report.recommended, quality=1.0, values=values),),
    )
    drawn = figures.figures(counted)
    histogram, line, trace = (drawn[name].axes[0] for name in ("shake_recommended", "surface", "trace"))
    shares = pytest.approx((-0.05, 1.05))
    assert (histogram.get_xlim(), line.get_ylim(), trace.get_ylim()) == (shares, shares, shares)
    assert histogram.get_xlabel().startswith("share of executions that succeed (")
    assert line.get_ylabel() == trace.get_ylabel() == "share of executions that succeed"
    told = {round(bar.get_x() + bar.get_width() / 2, 9): bar.get_height() for bar in histogram.patches}
    assert (told[0.0], told[1.0]) == (np.sum(values == 0.0), np.sum(values == 1.0))


def test_trials_without_a_value_are_crosses_in_a_figure_of_one_variable(rkhs_report):
    y = rkhs_report.y.copy()
    y[[2, 5]] = np.nan
    broken = replace(rkhs_report, y=y)
    name = next(name for name in figures.figures(broken) if name.startswith("surface"))
    crosses = [f"trial {i}" for i in np.flatnonzero(marked(broken, broken.surfaces[0])["trials-without-value"])]
    drawing = figures.svg_text(figures.figures(broken)[name], name)
    text = figures.inline_svg(drawing, name, "model", {"trials-without-value": crosses})
    assert crosses == ["trial 2", "trial 5"]
    assert text.count("<title>trial ") == 2
    assert "trials-without-value" not in figures.svg_text(figures.figures(rkhs_report)[name], name)
