"""Cells of a CSV file that a spreadsheet must not take for a formula (CWE-1236)."""

from typing import Any, Final

__all__ = ["cell_text", "written_cell"]

_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def written_cell(value: Any) -> Any:
    """Return a value as it is written: a text that a spreadsheet would compute gets an apostrophe in front.

    Numbers, and texts that are numbers, stay as they are.

    Examples
    --------
    >>> written_cell("=1+1"), written_cell("-0.5"), written_cell(-0.5), written_cell("mug")
    ("'=1+1", '-0.5', -0.5, 'mug')
    """
    if not isinstance(value, str) or not value.lstrip("'").startswith(_FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def cell_text(text: str) -> str:
    """Return what `written_cell` was given.

    Examples
    --------
    >>> cell_text("'=1+1"), cell_text("'mug"), cell_text("-0.5")
    ('=1+1', "'mug", '-0.5')
    """
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(_FORMULA) else text
