"""OBJ and PLY files: the same solid from all their forms, trimesh's for a ball, and what is refused with its line."""

import struct

import numpy as np
import pytest
import trimesh

from surehold.errors import InputError
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.mesh_files import load_mesh
from surehold.grasping.object.obj_files import read_obj
from surehold.grasping.object.ply_files import read_ply

# An angle iron, 60 x 60 x 30 mm with walls of 20 mm: its ends are faces of six corners with a notch.
OUTLINE = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 20.0], [20.0, 20.0], [20.0, 60.0], [0.0, 60.0]])
AREA, VOLUME = 2 * 2000.0 + 240.0 * 30.0, 2000.0 * 30.0  # mm^2, mm^3


def iron(first=0):
    """Return vertices, and faces by their corners, from that corner of the outline on."""
    outline = np.roll(OUTLINE, -first, axis=0)
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 30.0)])
    sides = [[i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    return vertices, [list(range(5, -1, -1)), list(range(6, 12)), *sides]


def obj_text(vertices, faces, backwards=False, start=0):
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices]
    named = [[i - len(vertices) if backwards else i + 1 + start for i in face] for face in faces]
    return "\n".join([*lines, *("f " + " ".join(map(str, face)) for face in named)]) + "\n"


def ply_content(vertices, faces, form):
    head = (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement vertex {len(vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(faces)}\nproperty uchar red\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        rows = [" ".join(f"{c:g}" for c in vertex) for vertex in vertices]
        rows += [f"7 {len(face)} " + " ".join(map(str, face)) for face in faces]
        return head + "\n".join(rows).encode() + b"\n"
    order = "<" if form == "binary_little_endian" else ">"
    packed = [struct.pack(f"{order}BB{len(face)}i", 7, len(face), *face) for face in faces]
    return head + np.asarray(vertices, dtype=f"{order}f4").tobytes() + b"".join(packed)


def solid_of(path):
    body = load_mesh(path, "mm").object
    mesh = trimesh.Trimesh(1e3 * body.vertices, body.faces, process=False)
    return body, mesh.area, mesh.volume


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("form", ["obj", "ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_with_a_notch_are_not_filled(tmp_path, form, first):
    path = tmp_path / ("iron.obj" if form == "obj" else "iron.ply")
    text = obj_text(*iron(first)).encode() if form == "obj" else ply_content(*iron(first), form)
    path.write_bytes(text)
    _, area, volume = solid_of(path)
    assert area == pytest.approx(AREA)
    assert volume == pytest.approx(VOLUME)


def test_a_hand_reaches_into_the_notch(tmp_path):
    (tmp_path / "iron.obj").write_text(obj_text(*iron(1)))
    body, _, _ = solid_of(tmp_path / "iron.obj")
    inside = [[0.04, 0.04, 0.0], [0.04, 0.04, 0.03], [0.03, 0.03, 0.015]]
    # 10 mm is exact; beyond 13 mm distances may be too large by a quarter of a cell
    assert distance_field_of(body).distance(np.array(inside)) == pytest.approx([0.02, 0.02, 0.01], abs=3e-4)


def test_faces_that_lie_on_each_other_leave_distances_finite(tmp_path, monkeypatch):
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))  # or an earlier run's are read
    # The fans of the notched ends, as a program wrote them into an STL file: they reach over the notch and back.
    vertices, faces = iron(1)
    fans = [[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)]
    trimesh.Trimesh(vertices, fans, process=False).export(tmp_path / "iron.stl")
    assert np.all(np.isfinite(distance_field_of(load_mesh(tmp_path / "iron.stl", "mm").object).nodes))


def test_vertices_of_an_obj_counted_backwards_are_those_before_the_face(tmp_path):
    vertices, faces = iron()
    beside = vertices + np.array([200.0, 0.0, 0.0])
    forms = [
        obj_text(vertices, faces) + "o second\n" + obj_text(beside, faces, start=12),
        obj_text(vertices, faces, backwards=True) + "o second\n" + obj_text(beside, faces, backwards=True),
    ]
    read = [read_obj(form.encode()) for form in forms]
    assert np.array_equal(read[0][0], read[1][0])
    assert np.array_equal(read[0][1], read[1][1])
    assert sorted(set(read[0][1].ravel())) == list(range(24))


def test_words_beside_vertices_and_faces_are_passed_over():
    text = (
        "# 2 kinds of lines\nmtllib none.mtl\no part\n  v 0 0 0 0.5 0.5 0.5\nv\t1 0 0 # second\r\nv 0 1e0 0\nvn 0 0 1\n"
        "vt 0.5 0.5\ns off\nusemtl none\nf 1/1/1 \\\n 2//1 3/1\nl 1 2\n"
    )
    vertices, faces = read_obj(text.encode())
    assert vertices.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("line", ["# C:\\parts\\", "mtllib C:\\parts\\", "g left\\"])
def test_a_path_that_ends_in_a_backslash_swallows_no_line(line):
    vertices, faces = iron()
    plain, (first, *rest) = obj_text(vertices, faces), obj_text(vertices, faces).split("\n")
    before_faces = plain.replace("f ", f"{line}\nf ", 1)
    for text in ("\n".join([line, first, *rest]), before_faces):
        for found, expected in zip(read_obj(text.encode()), read_obj(plain.encode()), strict=True):
            assert np.array_equal(found, expected)


@pytest.mark.parametrize("kind", ["obj", "ply", "ply of text"])
def test_a_ball_is_read_as_trimesh_reads_it(kind):
    ball = trimesh.creation.icosphere(2, 30.0)
    words = {"encoding": "ascii"} if kind == "ply of text" else {}
    content = ball.export(file_type=kind[:3], **words)
    if kind == "obj":
        vertices, faces = read_obj(content.encode())
        assert np.array_equal(faces, ball.faces)
    else:
        found = read_ply(content)
        vertices = found.vertices
        assert np.array_equal(found.corners.reshape(-1, 3), ball.faces)
        assert np.all(found.counts == 3)
    assert vertices == pytest.approx(ball.vertices, abs=1e-5)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_labels_of_64_bits_that_trimesh_writes_are_passed_over(encoding):
    ball = trimesh.creation.icosphere(1, 30.0)
    ball.vertex_attributes["label"] = np.arange(len(ball.vertices))
    ball.face_attributes["part"] = np.arange(len(ball.faces))
    content = trimesh.exchange.ply.export_ply(ball, encoding=encoding)
    assert content.count(b"property int64") == 2
    found = read_ply(content)
    assert found.vertices == pytest.approx(ball.vertices, abs=1e-5)
    assert np.array_equal(found.corners.reshape(-1, 3), ball.faces)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_an_element_without_properties_has_no_rows(form):
    """Of text it took the faces; of a binary file it was counted to the end."""
    content = ply_content(*iron(), form)
    more = content.replace(b"element face", b"element nothing 1000000000000\nelement face")
    assert np.array_equal(read_ply(more).corners, read_ply(content).corners)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("mixed", [False, True])
def test_lists_beside_the_corners_may_hold_any_number(form, mixed):
    """MeshLab writes coordinates of a texture at the corners of each face, NaN where there are none."""
    faces = [[0, 1, 2], [0, 2, 3], *([[0, 1, 2, 3]] if mixed else [])]
    places = [[np.nan, 0.5] * len(face) for face in faces]
    head = (
        f"ply\nformat {form} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
        "property list uchar float texcoord\nend_header\n"
    ).encode()
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
    if form == "ascii":
        rows = [" ".join(map(str, [len(f), *f, len(p), *p])) for f, p in zip(faces, places, strict=True)]
        body = "\n".join([*(" ".join(map(str, vertex)) for vertex in square.tolist()), *rows]).encode()
    else:
        packed = [
            struct.pack(f"<B{len(f)}iB{len(p)}f", len(f), *f, len(p), *p) for f, p in zip(faces, places, strict=True)
        ]
        body = square.tobytes() + b"".join(packed)
    found = read_ply(head + body)
    assert found.corners.tolist() == [corner for face in faces for corner in face]
    assert found.counts.tolist() == [len(face) for face in faces]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n", "line 3 has a vertex without three coordinates, '0 x 0'"),
        ("a.obj", "v 0 0 0\nv 1 0\n", "line 2 has a vertex without three coordinates, '1 0'"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n", "line 5: its face has vertex 4 of 3"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 -3 2\nv 0 1 0\n", "line 3: its face has vertex -3 of 3"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4: its face has vertex 0 of 3"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3.5\n", "line 4: its face is '1 2 3.5'"),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex x\nend_header\n",
            "line 3 of its header is 'element vertex x'",
        ),
        ("a.ply", "ply\nformat odd 1.0\nend_header\n", "line 2 of its header is 'format odd 1.0'"),
        ("a.ply", ply_content(*iron(), "ascii")[:-4].decode(), "row 8 of face is '7 4 5 0 6'"),
        ("a.ply", ply_content(*iron(), "ascii").decode().rsplit("\n", 3)[0], "ends before its 8 rows of face"),
        ("a.ply", ply_content(*iron(), "binary_big_endian")[:-9], "ends before its 8 rows of face"),
        ("a.ply", ply_content(*iron(), "binary_little_endian")[:-150], "ends before its 8 rows of face"),
        ("a.ply", ply_content(*iron(), "ascii").replace(b"float x", b"float w"), "its vertices are w y z"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as error:
        load_mesh(tmp_path / name, "mm")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_decimal_commas_are_read_beside_names_and_versions_with_points(tmp_path):
    vertices, faces = iron()
    text = obj_text(vertices + 0.5, faces).replace(".", ",")
    (tmp_path / "part.obj").write_text(f"# Modeler 2.93\no part.001\n{text}")
    row = ply_content(vertices + 0.5, faces, "ascii").partition(b"end_header")
    (tmp_path / "part.ply").write_bytes(row[0] + row[1] + row[2].replace(b".", b","))
    for name in ("part.obj", "part.ply"):
        assert "decimal commas" in load_mesh(tmp_path / name, "mm").diagnosis
        assert solid_of(tmp_path / name)[2] == pytest.approx(VOLUME)
