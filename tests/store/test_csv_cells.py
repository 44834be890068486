import pytest

from surehold.store.csv_cells import cell_text, written_cell


@pytest.mark.parametrize(
    "text", ["=1+1", "'=1+1", "''@x", "-0.5", "-a", "+", "'mug", "mug", "", "'", "\t1x", "=", "'-0.5"]
)
def test_every_text_comes_back_and_none_is_a_formula(text):
    cell = written_cell(text)
    assert cell_text(cell) == text
    assert not cell.startswith(("=", "@", "\t", "\r"))
    if cell.startswith(("+", "-")):
        float(cell)
