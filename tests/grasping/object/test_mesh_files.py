"""Meshes of one's own: what is refused and why, what is repaired, and closed forms of size, mass and box."""

import gzip
import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping import Simulator, default_pose
from surehold.grasping.object.mesh_files import load_mesh
from surehold.grasping.physics.convex_pieces import convex_pieces

BOX = (60.0, 40.0, 30.0)


def box():
    return trimesh.creation.box(BOX)


def ball(radius=30.0, subdivisions=3):
    return trimesh.creation.icosphere(subdivisions, radius)


def stored(tmp_path, mesh, name="part.stl"):
    mesh.export(tmp_path / name)
    return tmp_path / name


def without(mesh, count):
    mesh.update_faces(np.arange(len(mesh.faces)) >= count)
    return mesh


def refused(path, *words, unit="mm", **options):
    with pytest.raises(InputError) as error:
        load_mesh(path, unit, **options)
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.ply", "part.glb"])
def test_every_format_gives_the_same_box(tmp_path, name):
    mesh = box()
    if name.endswith("glb"):
        mesh.apply_scale(1e-3)
    loaded = load_mesh(stored(tmp_path, mesh, name), None if name.endswith("glb") else "mm")
    assert len(loaded.object.vertices) == 8
    assert sorted(2e3 * loaded.object.box_half_extents) == pytest.approx([30.0, 40.0, 60.0], abs=1e-3)
    assert loaded.object.mass == pytest.approx(0.072)
    assert "12 triangles" in loaded.diagnosis
    assert loaded.diagnosis.endswith("72 g at 1000 kg/m^3")


def test_mass_box_and_center_of_a_turned_box(tmp_path):
    mesh = box()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 2, 3)))
    mesh.apply_translation((100.0, 0.0, 20.0))
    part = load_mesh(stored(tmp_path, mesh), "mm", mass=0.4).object
    assert part.mass == 0.4
    np.testing.assert_allclose(part.center_of_mass, (0.1, 0.0, 0.02), atol=1e-7)
    np.testing.assert_allclose(sorted(2e3 * part.box_half_extents), sorted(BOX), atol=1e-3)
    truth = Rotation.from_rotvec(0.5 * np.array([1, 2, 3]) / np.sqrt(14.0)).as_matrix()
    np.testing.assert_allclose(np.abs(part.axes), np.abs(truth), atol=1e-4)
    assert np.linalg.det(part.axes) == pytest.approx(1.0)
    np.testing.assert_array_equal(load_mesh(tmp_path / "part.stl", "mm", frame="file").object.axes, np.eye(3))


def l_shape():
    """Return an L of 100 x 20 x 80 mm."""
    outline = np.array([(0, 0), (100, 0), (100, 20), (20, 20), (20, 80), (0, 80)], dtype=float)
    top = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    sides = [((i, (i + 1) % 6, (i + 1) % 6 + 6), (i, (i + 1) % 6 + 6, i + 6)) for i in range(6)]
    faces = [*top, *[(c + 6, b + 6, a + 6) for a, b, c in top], *[(c, b, a) for pair in sides for a, b, c in pair]]
    corners = np.vstack([np.column_stack([outline[:, 0], np.full(6, y), outline[:, 1]]) for y in (20.0, 0.0)])
    return trimesh.Trimesh(corners, faces, process=False)


@pytest.mark.parametrize(
    ("mesh", "edges"),
    [
        (trimesh.creation.box((40.0, 40.0, 40.0)), (40.0, 40.0, 40.0)),
        (trimesh.creation.box((100.0, 100.0, 10.0)), (10.0, 100.0, 100.0)),
        (trimesh.creation.cylinder(30.0, 20.0, sections=6), (20.0, 30.0 * np.sqrt(3.0), 60.0)),
        (l_shape(), (20.0, 80.0, 100.0)),
    ],
    ids=["cube", "plate", "hexagon", "L"],
)
def test_the_box_of_a_part_is_the_same_however_its_file_turns_it(tmp_path, mesh, edges):
    """Moments of inertia do not say where the faces of a cube or of an L are. Torques count by the longest edge."""
    for seed in range(4):
        turned = mesh.copy()
        if seed:
            turned.apply_transform(np.block([[Rotation.random(rng=seed).as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]]))
        part = load_mesh(stored(tmp_path, turned), "mm").object
        np.testing.assert_allclose(sorted(2e3 * part.box_half_extents), edges, rtol=0.01)
        assert part.torque_length == pytest.approx(5e-4 * max(edges), rel=0.002)
        np.testing.assert_allclose(part.axes.T @ part.axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(part.axes) == pytest.approx(1.0)


@pytest.mark.parametrize(("angle", "turned"), [(0.0023, False), (0.0092, True)])
def test_a_box_is_turned_where_that_makes_it_smaller_by_a_hundredth(tmp_path, angle, turned):
    """Turned by a small angle the box about 60 x 40 mm grows by (60^2 + 40^2) / (60 40) of it: by 0.5 %, or 2 %."""
    mesh = box()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(angle, (0, 0, 1)))
    loaded = load_mesh(stored(tmp_path, mesh), "mm")
    expected = Rotation.from_rotvec([0.0, 0.0, angle * turned]).as_matrix()
    np.testing.assert_allclose(loaded.object.axes, expected, atol=1e-5)
    assert ("its box is turned" in loaded.diagnosis) == turned


def test_axes_of_a_body_of_revolution_are_those_of_the_file(tmp_path):
    mesh = trimesh.creation.cylinder(20.0, 100.0, sections=32)
    part = load_mesh(stored(tmp_path, mesh), "mm", frame="principal").object
    np.testing.assert_allclose(part.axes, np.eye(3), atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_axes_across_a_body_of_revolution_lie_nearest_to_those_of_the_file(tmp_path, seed):
    """No turn about the body's own axis brings them nearer, measured by the trace of the rotation."""
    turn, mesh = Rotation.random(rng=seed).as_matrix(), trimesh.creation.cylinder(20.0, 100.0, sections=64)
    mesh.apply_transform(np.block([[turn, np.zeros((3, 1))], [0, 0, 0, 1]]))
    axes = load_mesh(stored(tmp_path, mesh), "mm", frame="principal").object.axes
    assert np.abs(axes.T @ turn[:, 2]).max() == pytest.approx(1.0, abs=1e-6)
    turns = Rotation.from_rotvec(np.linspace(-np.pi, np.pi, 721)[:, None] * turn[:, 2]).as_matrix()
    assert np.trace(axes) == pytest.approx(np.trace(turns @ axes, axis1=1, axis2=2).max(), abs=1e-4)


def test_units_are_lengths(tmp_path):
    for unit in ("furlong", "", "MM"):
        refused(stored(tmp_path, box()), f"unit '{unit}' is unknown", "mm, cm, m, in", unit=unit)


@pytest.mark.parametrize(("unit", "meters"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("in", 0.0254)])
def test_each_unit_is_its_length_in_meters(tmp_path, unit, meters):
    part = load_mesh(stored(tmp_path, trimesh.creation.box(np.array([0.06, 0.04, 0.03]) / meters)), unit).object
    assert sorted(2.0 * part.box_half_extents) == pytest.approx([0.03, 0.04, 0.06], rel=1e-6)


def test_thin_plates_are_solids_and_near_corners_stay_apart(tmp_path):
    plate = load_mesh(stored(tmp_path, trimesh.creation.box((60.0, 40.0, 0.5))), "mm").object
    assert plate.mass == pytest.approx(0.0012)
    corner, cut = np.array([30.0, 20.0, 15.0]), 0.004 * np.eye(3)  # a corner broken by 4 micrometers
    points = np.vstack([box().vertices[~np.all(box().vertices == corner, axis=1)], corner - cut])
    assert len(load_mesh(stored(tmp_path, trimesh.convex.convex_hull(points), "cut.ply"), "mm").object.vertices) == 10


@pytest.mark.parametrize(("triangles", "share"), [(47, 0.089), (58, 0.112)])
def test_a_tenth_of_the_area_may_be_open(tmp_path, triangles, share):
    """Of the top, of 2,400 of 10,800 mm^2, in 128 triangles."""
    mesh = box().subdivide().subdivide().subdivide()
    top = np.flatnonzero(mesh.triangles_center[:, 2] > 14.99)
    assert len(top) == 128
    gone = top[np.argsort(mesh.triangles_center[top, 0], kind="stable")[:triangles]]
    mesh.update_faces(~np.isin(np.arange(len(mesh.faces)), gone))
    open_area = triangles * 2400.0 / 128.0
    assert open_area / (10_800.0 - open_area) == pytest.approx(share, abs=5e-4)
    path = stored(tmp_path, mesh, "open.ply")
    if share > 0.1:
        refused(path, "is an open surface", "of 11 % of its area")
    else:
        loaded = load_mesh(path, "mm")
        assert f"of {open_area:.2g} mm^2" in loaded.diagnosis
        assert loaded.object.mass == pytest.approx(0.072, rel=1e-6)


def test_size_in_mm_and_the_unit_that_would_fit(tmp_path):
    path = stored(tmp_path, box())
    refused(path, "60,000 x 40,000 x 30,000 mm in unit m", "too large", "is its unit mm", unit="m")
    small = box()
    small.apply_scale(1e-3)
    refused(stored(tmp_path, small, "small.stl"), "0.06 x 0.04 x 0.03 mm", "too small", "is its unit m?")
    refused(path, "does not say its unit", unit=None)


def test_inside_out_is_turned_and_said(tmp_path):
    mesh = ball()
    mesh.invert()
    loaded = load_mesh(stored(tmp_path, mesh), "mm")
    assert "inside out" in loaded.diagnosis
    again = trimesh.Trimesh(loaded.object.vertices, loaded.object.faces)
    assert again.volume > 0.0


def test_a_small_hole_is_bridged_and_a_large_one_refused(tmp_path):
    loaded = load_mesh(stored(tmp_path, without(ball(), 4), "hole.ply"), "mm")
    assert "not watertight: 1 hole" in loaded.diagnosis
    closed = trimesh.Trimesh(loaded.object.vertices, loaded.object.faces)
    assert closed.is_watertight
    assert len(convex_pieces(loaded.object.vertices, loaded.object.faces)) == 1, "the check by physics takes it"
    simulator = Simulator(obj=loaded.object)
    assert simulator.field.distance(np.zeros((1, 3)))[0] == pytest.approx(-0.030, abs=0.001)
    refused(stored(tmp_path, without(box(), 2), "open.stl"), "60 x 40 x 30 mm", "open surface")


def test_normals_that_disagree_are_refused(tmp_path):
    mesh = ball()
    faces = mesh.faces.copy()
    faces[::2] = faces[::2, ::-1]
    mixed = trimesh.Trimesh(mesh.vertices, faces, process=False)
    refused(stored(tmp_path, mixed, "mixed.ply"), "disagree about what is outside")


def test_single_triangles_that_are_inside_out_are_turned(tmp_path):
    mesh = box().subdivide().subdivide().subdivide()
    faces = mesh.faces.copy()
    faces[[5, 6, 400]] = faces[[5, 6, 400], ::-1]
    loaded = load_mesh(stored(tmp_path, trimesh.Trimesh(mesh.vertices, faces, process=False), "few.ply"), "mm")
    assert "3 triangles were inside out among others and turned" in loaded.diagnosis
    part = loaded.object
    assert part.mass == pytest.approx(0.072, rel=1e-6)
    np.testing.assert_allclose(part.center_of_mass, 0.0, atol=1e-9)
    assert trimesh.Trimesh(part.vertices, part.faces, process=False).is_winding_consistent
    assert len(convex_pieces(part.vertices, part.faces)) == 1, "the check by physics takes it"


def test_degenerate_and_flat(tmp_path):
    refused(
        stored(tmp_path, trimesh.Trimesh([[0, 0, 0], [10, 0, 0], [0, 10, 0]], [[0, 1, 2]], process=False), "one.ply"),
        "flat",
        "10 x 10 x 0 mm",
    )
    refused(stored(tmp_path, trimesh.creation.box((60, 40, 0.0001)), "sheet.stl"), "flat")
    line = trimesh.Trimesh([[0, 0, 0], [10, 0, 0], [20, 0, 0]], [[0, 1, 2]], process=False)
    refused(stored(tmp_path, line, "line.ply"), "none of its 1 triangles has an area")


def test_triangles_without_area_are_left_out(tmp_path):
    mesh = box()
    faces = np.vstack([mesh.faces, [[0, 0, 1]]])
    loaded = load_mesh(stored(tmp_path, trimesh.Trimesh(mesh.vertices, faces, process=False), "extra.ply"), "mm")
    assert "1 triangles without area are left out" in loaded.diagnosis


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_coordinates_that_are_not_finite(tmp_path, value):
    content = bytearray(stored(tmp_path, box()).read_bytes())
    struct.pack_into("<f", content, 84 + 12, value)
    (tmp_path / "bad.stl").write_bytes(content)
    refused(tmp_path / "bad.stl", "not finite")


def test_a_size_beyond_measure_is_said_in_few_digits(tmp_path):
    far = "v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "far.obj").write_text(far)
    with pytest.raises(InputError, match=r"1e\+30") as caught:
        load_mesh(tmp_path / "far.obj", unit="m")
    assert len(str(caught.value)) < 300


def test_damaged_files(tmp_path):
    whole = stored(tmp_path, box()).read_bytes()
    glb = box()
    glb.apply_scale(1e-3)
    cases = {
        "empty.stl": b"",
        "cut.stl": whole[:200],
        "many.stl": whole[:80] + struct.pack("<I", 4_000_000_000) + whole[84:],
        "noise.stl": np.random.default_rng(0).bytes(5000),
        "noise.ply": np.random.default_rng(1).bytes(5000),
        "noise.glb": np.random.default_rng(2).bytes(5000),
        "noise.gltf": np.random.default_rng(3).bytes(5000),
        "noise.obj": np.random.default_rng(4).bytes(5000),
        "cut.glb": stored(tmp_path, glb, "part.glb").read_bytes()[:-100],
        "list.gltf": b"[1, 2]",
        "deep.gltf": b"[" * 100_000,
        "five.gltf": b'{"asset": {"version": "2.0"}, "meshes": 5}',
        "count.gltf": b'{"asset": {"version": "2.0"}, "accessors": [{"count": 1000000000000, "type": "VEC3"}]}',
        "null.gltf": b'{"buffers": null}',
        "index.obj": b"v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 9\n",
        "points.obj": b"v 0 0 0\nv 1 1 1\n",
    }
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, name)
    refused(tmp_path / "nowhere.stl", "cannot read")
    refused(tmp_path, "is no mesh file")


def test_archives_are_not_opened(tmp_path):
    for name in ("part.zip", "part.3mf", "part.tar.gz"):
        refused(tmp_path / name, "archives are not opened")
    (tmp_path / "packed.stl").write_bytes(gzip.compress(stored(tmp_path, box()).read_bytes()))
    refused(tmp_path / "packed.stl", "is an archive")


def test_nothing_outside_the_file_is_read(tmp_path, monkeypatch):
    path = tmp_path / "part.obj"
    lines = ["mtllib /etc/passwd", "mtllib secret.mtl", "usemtl a", *(f"v {p}" for p in ("0 0 0", "10 0 0", "0 10 0"))]
    path.write_text("\n".join([*lines, "v 0 0 10", "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]))
    (tmp_path / "secret.mtl").write_text("newmtl a\nmap_Kd /etc/passwd\n")
    opened = []
    read = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: opened.append(self) or read(self))
    monkeypatch.setattr("builtins.open", lambda *a, **k: pytest.fail(f"{a} was opened"))
    assert load_mesh(path, "mm").object.mass == pytest.approx(1e-3 / 6.0)
    assert opened == [path]


@pytest.mark.parametrize("where", ["/etc/passwd", "http://localhost:1/a.bin", "../data.bin"])
def test_buffers_elsewhere_are_refused_and_textures_ignored(tmp_path, where):
    mesh = box()
    mesh.apply_scale(1e-3)
    parts = trimesh.Scene(mesh).export(file_type="gltf", embed_buffers=True)
    data = json.loads(parts["model.gltf"] if isinstance(parts, dict) else parts)
    path = tmp_path / "part.gltf"
    textured = data | {"images": [{"uri": where}], "textures": [{"source": 0}], "materials": [{"name": "m"}]}
    path.write_text(json.dumps(textured))
    assert load_mesh(path).object.mass == pytest.approx(0.072)
    data["buffers"][0]["uri"] = where
    path.write_text(json.dumps(data))
    refused(path, "keeps its triangles in", "outside its folder", unit=None)


def test_a_buffer_in_the_folder_is_read_and_a_link_out_of_it_is_not(tmp_path):
    mesh = box()
    mesh.apply_scale(1e-3)
    folder = tmp_path / "part"
    folder.mkdir()
    for name, content in trimesh.Scene(mesh).export(file_type="gltf").items():
        (folder / name).write_bytes(content)
    path = folder / "model.gltf"
    uri = json.loads(path.read_text())["buffers"][0]["uri"]
    assert not uri.startswith("data:")
    assert load_mesh(path).object.mass == pytest.approx(0.072)
    (folder / uri).rename(tmp_path / "data.bin")
    (folder / uri).symlink_to(tmp_path / "data.bin")
    refused(path, "outside its folder", unit=None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sparse": {"count": 1, "indices": {"bufferView": 0}, "values": {"bufferView": 0}}}, "sparse accessors"),
        ({"componentType": 5123, "normalized": True}, "whole numbers normalized"),
    ],
)
def test_vertices_that_are_not_read_as_they_are_stored_are_refused(tmp_path, change, said):
    data = json.loads(trimesh.exchange.gltf.export_gltf(trimesh.Scene(box()))["model.gltf"])
    place = data["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    data["accessors"][place] |= change
    data["buffers"] = [{"byteLength": 4, "uri": "data:application/octet-stream;base64,AAAAAA=="}]
    (tmp_path / "part.gltf").write_text(json.dumps(data))
    refused(tmp_path / "part.gltf", said, "export plain floats", unit=None)


def test_a_fan_of_triangles_is_refused(tmp_path):
    data = json.loads(trimesh.exchange.gltf.export_gltf(trimesh.Scene(box()))["model.gltf"])
    data["meshes"][0]["primitives"][0]["mode"] = 6
    data["buffers"] = [{"byteLength": 4, "uri": "data:application/octet-stream;base64,AAAAAA=="}]
    (tmp_path / "part.gltf").write_text(json.dumps(data))
    refused(tmp_path / "part.gltf", "a fan of triangles", unit=None)


def test_options(tmp_path):
    path = stored(tmp_path, box())
    for mass in (0.0, -1.0, np.nan, 1e9):
        refused(path, "mass is", mass=mass)
    refused(path, "frame 'weird' is unknown", frame="weird")


def test_a_user_mesh_is_grasped_like_the_same_shipped_solid(tmp_path):
    """A mesh of the bottle and the bottle's closed forms differ by what the grid and the chords of the circle do."""
    shipped = Simulator(obj="bottle")
    mesh = trimesh.Trimesh(1e3 * shipped.object.vertices, shipped.object.faces, process=False)
    part = load_mesh(stored(tmp_path, mesh), "mm", mass=shipped.object.mass, frame="file").object
    own = Simulator(obj=part, friction=shipped.friction)
    pose = default_pose(shipped.hand, shipped.object, "right-front", 0.0087, (-0.032, 0.0, 0.0, 0.0, 0.0, 0.0))
    expected, found = shipped.grasp(pose, -0.7), own.grasp(pose, -0.7)
    assert found.status == expected.status == "ok"
    np.testing.assert_allclose(found.joints, expected.joints, atol=0.02)
    assert found.quality == pytest.approx(expected.quality, rel=0.1)


def boxes(*placed):
    """Return cubes of 60 mm, or of a given size, at places along x and y, as one mesh."""
    parts = []
    for x, y, size, inverted in placed:
        part = trimesh.creation.box((size, size, size))
        part.apply_translation((x, y, 0.0))
        if inverted:
            part.invert()
        parts.append(part)
    return trimesh.util.concatenate(parts)


@pytest.mark.parametrize(
    ("placed", "grams", "center", "words"),
    [
        ([(0, 0, 60, True), (80, 0, 40, False)], 280.0, 18.2857, "1 of its 2 bodies was inside out"),
        ([(0, 0, 60, True), (80, 0, 40, True)], 280.0, 18.2857, "it was inside out and is turned"),
        ([(0, 0, 60, False), (60, 0, 60, False)], 432.0, 30.0, ""),
        ([(0, 0, 60, False), (50, 0, 40, False)], 280.0, 11.4286, ""),
        ([(0, 0, 60, False), (60, 60, 60, False)], 432.0, 30.0, ""),
        ([(0, 0, 60, False), (60, 60, 60, True)], 432.0, 30.0, "1 of its 2 bodies was inside out"),
        ([(0, 0, 60, False), (30, 0, 60, False)], 324.0, 15.0, "overlap by 108 ml"),
        ([(0, 0, 60, False), (10, 0, 30, False)], 216.0, 0.0, "overlap by 27 ml"),
        ([(0, 0, 60, False), (0, 0, 30, True)], 189.0, 0.0, ""),
        ([(0, 0, 60, True), (0, 0, 30, False)], 189.0, 0.0, "inside out"),
    ],
    ids=[
        "inverted",
        "all-inverted",
        "face",
        "part-of-a-face",
        "edge",
        "edge-inverted",
        "overlap",
        "within",
        "cavity",
        "cavity-inverted",
    ],
)
def test_bodies_are_turned_united_and_counted_once(tmp_path, placed, grams, center, words):
    loaded = load_mesh(stored(tmp_path, boxes(*placed)), "mm", frame="file")
    part = loaded.object
    assert 1e3 * part.mass == pytest.approx(grams, rel=1e-6)
    assert 1e3 * part.center_of_mass[0] == pytest.approx(center, abs=1e-3)
    assert words in loaded.diagnosis
    assert words or ";" not in loaded.diagnosis, "nothing to say"
    hulls = [trimesh.convex.convex_hull(piece).volume for piece in convex_pieces(part.vertices, part.faces)]
    assert 1e6 * sum(hulls) == pytest.approx(grams, rel=0.01), "the check by physics has the same solid"


def test_bodies_apart_are_said_to_be_taken_as_one(tmp_path):
    loaded = load_mesh(stored(tmp_path, boxes((0, 0, 60, False), (80, 0, 40, False), (60, 0, 60, False))), "mm")
    assert "rigid" not in loaded.diagnosis, "the one between joins them"
    loaded = load_mesh(stored(tmp_path, boxes((0, 0, 60, False), (80, 0, 40, False), (0, 0, 30, True))), "mm")
    assert loaded.diagnosis.endswith("2 bodies that do not touch are taken as one rigid object")
    assert loaded.object.mass == pytest.approx(0.216 + 0.064 - 0.027)


def test_inside_is_inside_of_a_body_that_was_turned(tmp_path):
    part = load_mesh(stored(tmp_path, boxes((0, 0, 60, True), (80, 0, 40, False))), "mm", frame="file").object
    found = Simulator(obj=part).field.distance(np.array([[-0.029, 0.0, 0.0], [0.080, 0.0, 0.019], [0.045, 0.0, 0.0]]))
    np.testing.assert_allclose(found, [-0.001, -0.001, 0.015], atol=2e-4)


def test_doubled_triangles_are_left_out(tmp_path):
    mesh = box()
    for name, faces in {"same": mesh.faces, "two-sided": mesh.faces[:, ::-1]}.items():
        twice = trimesh.Trimesh(mesh.vertices, np.vstack([mesh.faces, faces]), process=False)
        loaded = load_mesh(stored(tmp_path, twice, f"{name}.stl"), "mm")
        assert "12 doubled triangles are left out" in loaded.diagnosis
        assert loaded.object.mass == pytest.approx(0.072)


def test_what_is_nearly_the_format_is_read_and_said(tmp_path):
    binary, text = stored(tmp_path, box()).read_bytes(), box().export(file_type="stl_ascii")
    obj = box().export(file_type="obj")
    commas = text.replace("1.0", "1.00").replace(".", ",")
    cases = {
        "behind.stl": (binary + b"exported by hand" * 3, "48 bytes behind the last triangle"),
        "zero.stl": (binary[:80] + bytes(4) + binary[84:], "counts no triangles, 12 follow"),
        "commas.stl": (commas.encode(), "decimal commas"),
        "mark.stl": (b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode(), "72 g"),
        "le.obj": (obj.encode("utf-16-le"), "UTF-16"),
        "be.obj": (obj.encode("utf-16-be"), "UTF-16"),
        "marked.obj": (obj.encode("utf-16"), "UTF-16"),
    }
    for name, (content, words) in cases.items():
        (tmp_path / name).write_bytes(content)
        loaded = load_mesh(tmp_path / name, "mm")
        assert loaded.object.mass == pytest.approx(0.072), name
        assert words in loaded.diagnosis


def test_what_is_no_mesh_is_named(tmp_path):
    (tmp_path / "part.obj").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 625707\n")
    refused(tmp_path / "part.obj", "a pointer of Git LFS", "git lfs pull")
    (tmp_path / "old.gltf").write_text('{"asset": {"version": "1.0"}, "meshes": {}, "buffers": {}}')
    refused(tmp_path / "old.gltf", "is glTF 1.0; export it as glTF 2.0", unit=None)
    (tmp_path / "old.glb").write_bytes(b"glTF" + struct.pack("<IIII", 1, 24, 4, 0) + b"{}  ")
    refused(tmp_path / "old.glb", "is glTF 1; export", unit=None)


def test_corners_of_two_coordinates_and_corners_that_nothing_uses(tmp_path):
    text = box().export(file_type="obj")
    flat = (line.rsplit(" ", 1)[0] if line.startswith("v ") else line for line in text.splitlines())
    (tmp_path / "plane.obj").write_text("\n".join(flat))
    refused(tmp_path / "plane.obj", "without three coordinates")
    (tmp_path / "far.obj").write_text(text + "\nv 1e300 0 0\nv nan 0 0\n")
    assert load_mesh(tmp_path / "far.obj", "mm").object.mass == pytest.approx(0.072)


def test_pipes_and_devices_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "endless.obj").symlink_to("/dev/zero")
    for name in ("pipe.stl", "endless.obj"):
        refused(tmp_path / name, "is no regular file")


def test_a_scale_multiplies_the_unit(tmp_path):
    path = stored(tmp_path, box())
    scaled, plain = load_mesh(path, "m", scale=1e-3).object, load_mesh(path, "mm").object
    np.testing.assert_allclose(scaled.vertices, plain.vertices, rtol=1e-12)
    for scale in (0.0, -1.0, np.nan):
        refused(path, "scale of 'part.stl'", "positive number", scale=scale)
