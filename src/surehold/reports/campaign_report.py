"""What the page of campaigns shows: sections of tables and pictures; plain data, nothing here computes or draws."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.reports.run_report import Scene

__all__ = ["Band", "CampaignReport", "Line", "Panel", "Picture", "Points", "Section", "Table"]

Floats = NDArray[np.floating]
Mark = Literal["", "good", "bad", "open"]


@dataclass(frozen=True)
class Line:
    """A line of a panel."""

    x: Floats  #: (g,)
    y: Floats  #: (g,)
    label: str = ""
    color: str = "#1b1f25"
    dashed: bool = False


@dataclass(frozen=True)
class Band:
    """A shaded band of a panel."""

    x: Floats  #: (g,)
    low: Floats  #: (g,)
    high: Floats  #: (g,)
    color: str = "#1b1f25"


@dataclass(frozen=True)
class Points:
    """Single points of a panel."""

    x: Floats  #: (g,)
    y: Floats  #: (g,)
    label: str = ""


@dataclass(frozen=True)
class Panel:
    """One pair of axes: lines, or a map of z over x and y."""

    title: str
    xlabel: str = ""
    ylabel: str = ""
    lines: tuple[Line, ...] = ()
    bands: tuple[Band, ...] = ()
    points: tuple[Points, ...] = ()
    verticals: tuple[tuple[float, str], ...] = ()  #: places of dashed red lines, and what they mark
    initial: float = 0.0  #: end of the initial design, shaded; 0 for none
    z: Floats | None = None  #: (g, g) over the unit square, first input along the first axis; drawn as a map


@dataclass(frozen=True)
class Picture:
    """A figure of one or several panels."""

    name: str  #: of its file, such as "figure-4.5"
    title: str
    panels: tuple[Panel, ...]
    caption: str = ""


@dataclass(frozen=True)
class Table:
    """A table of text; every row as long as the head."""

    name: str  #: of its CSV
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marks: tuple[Mark, ...] = ()  #: one a row: how it is to be seen; empty for none
    note: str = ""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.head) for row in self.rows) or (self.marks and len(self.marks) != len(self.rows)):
            raise InputError(f"table '{self.name}' has rows of other lengths than its head of {len(self.head)} cells.")


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class CampaignReport:
    """One page for one or several campaigns."""

    title: str
    headline: str
    facts: tuple[tuple[str, str], ...]  #: number and what it counts
    sections: tuple[Section, ...]
    scenes: Mapping[str, Scene] = field(default_factory=dict)  #: grasps in 3-D by label
    notes: tuple[str, ...] = ()
