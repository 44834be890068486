import csv
import io

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.reports import figures
from surehold.reports.campaign_figures import draw_picture
from surehold.reports.campaign_page import csv_text, markdown_table, render_campaigns
from surehold.reports.campaign_report import Band, CampaignReport, Line, Panel, Picture, Points, Section, Table

X = np.linspace(0.0, 10.0, 11)


def table(**changes):
    fields = {"name": "t", "title": "Results", "head": ("a", "b"), "rows": (("1", "x|y"), ("2, 3", "<i>"))}
    return Table(**(fields | changes))


def picture():
    lines = (Line(X, np.minimum(X, 5.0), "first"), Line(X, X / 3.0, "second", "#0a65b3", dashed=True))
    curves = Panel(
        "curves", "trial", "value", lines, (Band(X, X - 1, X + 1),), (Points(X, X),), ((4.0, "first split"),), 2.0
    )
    return Picture("figure-1", "Two panels", (curves, Panel("map", "x1", "x2", z=np.outer(X, X))))


def page(**changes):
    fields = {
        "title": "Campaigns",
        "headline": "It <holds>.",
        "facts": (("3", "runs"),),
        "sections": (Section("First", "text", (table(marks=("good", "bad")),), (picture(),)),),
    }
    report = CampaignReport(**(fields | changes))
    return render_campaigns(report, {"figure-1": figures.svg_text(draw_picture(picture()), "figure-1")})


def test_the_page_holds_everything_and_escapes_what_it_is_told():
    text = page(notes=("a <b>note</b>",))
    assert "It &lt;holds&gt;." in text
    assert "a &lt;b&gt;note&lt;/b&gt;" in text
    assert "&lt;i&gt;" in text
    assert '<td class="short good">' in text
    assert text.count("<svg") == 1
    assert "first split" in text
    assert "THREE" not in text, "a page without scenes needs no 3-D library"


def test_a_page_with_grasps_has_one_button_each(cylinder_scene):
    text = page(scenes={"Figure 4.2: bottle": cylinder_scene(), "Figure 4.2: mug": cylinder_scene(0.4)})
    assert text.count("data-view=") == 2
    assert "Figure 4.2: mug" in text
    assert 'id="scene-data"' in text


def test_csv_comes_back():
    assert list(csv.reader(io.StringIO(csv_text(table())))) == [["a", "b"], ["1", "x|y"], ["2, 3", "<i>"]]


def test_markdown_keeps_its_columns():
    assert markdown_table(table()).split("\n") == ["| a | b |", "|---|---|", "| 1 | x\\|y |", "| 2, 3 | <i> |"]


def test_figures_repeat_bit_for_bit():
    first, second = (figures.svg_text(draw_picture(picture()), "figure-1") for _ in range(2))
    assert first == second


def test_the_climb_out_of_the_initial_design_does_not_press_the_rest_flat():
    y = np.where(X < 2.0, -1000.0, X)
    axes = draw_picture(Picture("p", "", (Panel("p", lines=(Line(X, y),), initial=2.0),))).axes[0]
    assert axes.get_ylim()[0] > 0.0


def test_trials_are_counted_in_whole_numbers_and_inputs_are_not():
    trials = np.arange(1.0, 21.0)
    counted, inputs = (draw_picture(Picture("p", "", (Panel("p", lines=(Line(x, x),)),))) for x in (trials, X / 10.0))
    ticks = counted.axes[0].get_xticks()
    assert len(ticks) > 3
    assert np.all(ticks % 1.0 == 0.0)
    assert counted.axes[0].get_xlim() == (1.0, 20.0)
    assert np.any(inputs.axes[0].get_xticks() % 1.0 != 0.0)


@pytest.mark.parametrize("panels", [1, 2, 4])
def test_the_names_of_eight_methods_fit_into_the_figure(panels):
    names = ("surehold robust", "surehold", "Optuna GPSampler", "Optuna TPE", "Optuna CMA-ES", "BoTorch", "random")
    panel = Panel("p", lines=tuple(Line(X, X, name) for name in (*names, "BoTorch input perturbation")))
    figure = draw_picture(Picture("p", "", (panel,) * panels))
    figure.draw_without_rendering()
    shown = figure.legends[0].get_window_extent()
    assert shown.x0 >= 0
    assert shown.x1 <= figure.bbox.x1


def test_rows_of_another_length_are_refused():
    for changes in ({"rows": (("1",),)}, {"marks": ("good",)}):
        with pytest.raises(InputError, match="other lengths"):
            table(**changes)
