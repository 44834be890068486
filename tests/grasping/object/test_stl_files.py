"""STL files: the same solid from both of their forms, all of a text, and what is refused with its line."""

import struct

import numpy as np
import pytest
import trimesh

from surehold.errors import InputError
from surehold.grasping.object.mesh_files import load_mesh

SIZE = (60.0, 40.0, 30.0)  # mm


def text(middle=0.0):
    box = trimesh.creation.box(SIZE)
    box.apply_translation((0.0, middle, 0.0))
    return box.export(file_type="stl_ascii")


BINARY = trimesh.creation.box(SIZE).export(file_type="stl")
BOX = text()
COUNTED = struct.Struct("<I")


def loaded(tmp_path, content):
    (tmp_path / "part.stl").write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_mesh(tmp_path / "part.stl", "mm")


@pytest.mark.parametrize(
    "content",
    [
        BINARY,
        b"solid facet vertex" + BINARY[18:],
        BOX,
        BOX.upper(),
        "\n \n" + BOX,
        " ".join(BOX.split()),
        BOX.replace("solid", "solid 12 vertex 0 0 0 facet endsolid"),
        BOX.replace("facet normal", "facet normal nan"),
        BOX.encode("utf-16"),
    ],
)
def test_both_forms_are_the_same_solid(tmp_path, content):
    body = loaded(tmp_path, content).object
    np.testing.assert_allclose(2e3 * body.box_half_extents, SIZE)
    assert body.mass == pytest.approx(0.072)


@pytest.mark.parametrize("end", ["endsolid", ""])
def test_no_solid_of_a_text_is_lost(tmp_path, end):
    """The second of two solids was left out without a word where its `endsolid` was missing."""
    both = loaded(tmp_path, BOX + text(60.0).replace("endsolid", end))
    np.testing.assert_allclose(2e3 * both.object.box_half_extents, (60.0, 100.0, 30.0))
    assert both.object.mass == pytest.approx(0.144)
    assert ("was it cut off?" in both.diagnosis) == (not end)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (BINARY[:-70], "counts 12 triangles, and 10 are there"),
        (BINARY[:80] + COUNTED.pack(17) + BINARY[84:], "counts 17 triangles, and 12 are there"),
        (BINARY[:60], "as long as the header"),
        (BOX[: BOX.index("vertex", 600)], "ends within the facet of line"),
        (BOX + BOX[: BOX.index("endfacet", 600)], r"one of its .* facets has no end"),
        (BOX.replace("endloop", "vertex 0 0 0\nendloop", 1), "line 2: its facet has 4 vertices"),
        ("solid\nvertex 0 0 0\n" + BOX, "line 2 has a vertex that is of no facet"),
        (BOX.replace("vertex", "vertex one", 1), "line 4 has a vertex without three coordinates, 'one "),
        ("solid\nendsolid\n", "holds no triangles"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path, content, words):
    with pytest.raises(InputError, match=words):
        loaded(tmp_path, content)
