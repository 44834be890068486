from base64 import b64decode

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.grasping.shape.cloud_files import read_cloud

POINTS = np.random.default_rng(0).standard_normal((7, 3)).astype(np.float32)
NORMALS = np.tile([0.0, 0.0, 1.0], (7, 1)).astype(np.float32)


def pcd(data, points, form, extra=b""):
    head = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _ rgb\nSIZE 4 4 4 1 4\nTYPE F F F U U\nCOUNT 1 1 1 4 1\n"
        f"WIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0.5 1 0 0 0\nPOINTS {points}\nDATA {form}\n"
    )
    return head.encode() + data + extra


def test_the_same_points_from_all_formats(tmp_path):
    import trimesh

    (tmp_path / "a.ply").write_bytes(trimesh.PointCloud(POINTS).export(file_type="ply"))
    np.savetxt(tmp_path / "a.xyz", np.hstack([POINTS, NORMALS]), header="made by a test")
    np.savez(tmp_path / "a.npz", points=POINTS, normals=NORMALS, camera=np.array([0.0, 0.0, 0.5]))
    record = np.zeros(7, dtype=[("p", "<f4", 3), ("pad", "u1", 4), ("rgb", "<u4")])
    record["p"] = POINTS
    (tmp_path / "b.pcd").write_bytes(pcd(record.tobytes(), 7, "binary"))
    rows = "\n".join(" ".join(map(repr, map(float, p))) + " 0 0 0 0 255" for p in POINTS)
    (tmp_path / "c.pcd").write_bytes(pcd(rows.encode(), 7, "ascii"))
    for name in ("a.ply", "a.xyz", "a.npz", "b.pcd", "c.pcd"):
        cloud = read_cloud(tmp_path / name)
        assert cloud.points == pytest.approx(POINTS, abs=1e-6), name
        assert (cloud.normals is not None) == (name in ("a.xyz", "a.npz")), name
        if name != "a.ply" and not name.endswith("xyz"):
            assert cloud.camera == pytest.approx([0.0, 0.0, 0.5]), name


# Compressed by liblzf: 40 points, x = 0.05 ((7 i) % 11) / 10 - 0.02, y = 0.03, z = 0.002 i, the x of all points first.
LZF = (
    "DgrXo7yPwnU8Cteju4/C9SAHACNAAwO8zczMIAcBozsgGwC8IAcBPAAgACAH4GgrQJPgkwMhFgsAbxIDO28Sgzumm8QgBwADITcJIzymm0Q8QmBlPCAX"
    "Azy8dJMgEwSjPFg5tCAXBMQ89P3UIBsA5WDXIC8MPZZDCz28dBM946UbPSA7DD0xCCw9WDk0PX9qPD0gRww9zcxMPfT9VD0bL109IFMEPWiRbT0hlwQ9"
    "tvN9PSBfAz0CK4cgQwSLPSlcjyBHBJM9UI2XIEsFmz13vp89"
)


def test_a_compressed_pcd_holds_field_after_field(tmp_path):
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 40\nHEIGHT 1\nPOINTS 40\n"
    packed = b64decode(LZF)
    sizes = np.array([len(packed), 480], dtype="<u4").tobytes()
    (tmp_path / "a.pcd").write_bytes(head.encode() + b"DATA binary_compressed\n" + sizes + packed)
    i = np.arange(40)
    expected = np.column_stack([0.05 * ((7 * i) % 11) / 10.0 - 0.02, np.full(40, 0.03), 0.002 * i])
    assert read_cloud(tmp_path / "a.pcd").points == pytest.approx(expected, abs=1e-6)
    flat = packed[:1] + b"\xff" + packed[1:]  # a byte too many
    more = np.array([len(flat), 480], dtype="<u4").tobytes()
    (tmp_path / "c.pcd").write_bytes(head.encode() + b"DATA binary_compressed\n" + more + flat)
    with pytest.raises(InputError, match="damaged"):
        read_cloud(tmp_path / "c.pcd")


def test_normals_of_a_ply(tmp_path):
    names = ("x", "y", "z", "nx", "ny", "nz")
    head = "ply\nformat ascii 1.0\nelement vertex 7\n" + "".join(f"property float {n}\n" for n in names)
    rows = "\n".join(" ".join(map(str, row)) for row in np.hstack([POINTS, NORMALS]).tolist())
    (tmp_path / "n.ply").write_text(head + "end_header\n" + rows + "\n")
    assert read_cloud(tmp_path / "n.ply").normals == pytest.approx(NORMALS)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.stl", b"solid", "is no point cloud"),
        ("a.xyz", b"", "holds no points"),
        ("a.xyz", b"1 2\n3 4\n", "2 numbers"),
        ("a.xyz", b"x y z\n", "cannot be read as XYZ"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "a.ply"),
        ("a.ply", b"\x00\x01", "cannot be read as PLY"),
        ("a.npz", b"PK", "cannot be read as NPZ"),
        ("a.pcd", b"VERSION 0.7\n", "no DATA line"),
        ("a.pcd", pcd(b"", 7, "binary"), "ends before its 7 points"),
        ("a.pcd", pcd(b"", 7, "binary_compressed"), "ends before its 7 points"),
        ("a.pcd", pcd(bytes([9, 0, 0, 0, 140, 0, 0, 0]) + b"\x00" + bytes(8), 7, "binary_compressed"), "damaged"),
        ("a.pcd", pcd(b"", 7, "binary_zip"), "its data are binary_zip"),
        ("a.pcd", pcd(b"", 0, "binary"), "holds no points"),
        ("a.pcd", pcd(b"1 2 3 0 0 0 0 0\n" * 6, 7, "ascii"), "6 rows of 8 numbers, its header says 7 of 8"),
        ("a.pcd", pcd(b"1 2 3 0\n" * 7, 7, "ascii"), "7 rows of 4 numbers, its header says 7 of 8"),
        ("a.pcd", pcd(b"", 7, "binary").replace(b"0 0 0.5", b"0 0 nan"), "VIEWPOINT is '0 0 nan 1 0 0 0'"),
        ("a.pcd", pcd(b"", 7, "binary").replace(b"0 0 0.5 1 0 0 0", b"0 0.5"), "VIEWPOINT is '0 0.5'"),
        ("a.pcd", pcd(b"", 7, "binary").replace(b"SIZE 4 4 4 1 4", b"SIZE 4 4 4"), "has 3 of SIZE for the 5 fields"),
        ("a.pcd", pcd(b"", 7, "binary").replace(b"TYPE F", b"TYPE C"), "TYPE and SIZE make '4'"),
        ("a.pcd", pcd(b"", -7, "binary"), "POINTS -7"),
        ("a.pcd", pcd(b"", 7, "binary").replace(b"FIELDS", b"NAMES"), "fields are not named"),
        ("a.xyz", b"2\n1 2 3\n4 5 6\n", "line 2 has 3 numbers, those before have 1"),
        ("a.xyz", b"1 2 3\n4 5 a\n", "line 2 is '4 5 a'"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n", "before its 2 rows"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said) as error:
        read_cloud(tmp_path / name)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("between", [" ", ";", "; ", "\t"])
def test_decimal_commas_are_no_columns(tmp_path, between):
    points = np.round(1e3 * POINTS, 2).astype(float)
    rows = [between.join(f"{v:g}".replace(".", ",") for v in point) for point in points]
    (tmp_path / "a.xyz").write_text("# millimeters, 1.5 per pixel\n" + "\n".join(rows))
    cloud = read_cloud(tmp_path / "a.xyz")
    assert cloud.points == pytest.approx(points)
    assert cloud.normals is None


@pytest.mark.parametrize("rows", ["1,2,3\n4,5,6\n", "1, 2, 3\n4, 5, 6", "1;2;3\n4;5;6\n", "1.0,2.0,3.0\n4.0,5.0,6.0\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_columns_may_be_apart_by_commas(tmp_path, rows, encoding):
    (tmp_path / "a.xyz").write_bytes(rows.encode(encoding))
    assert read_cloud(tmp_path / "a.xyz").points.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


@pytest.mark.parametrize(
    "colors",
    [
        np.random.default_rng(1).integers(0, 256, (7, 3)),
        np.random.default_rng(1).random((7, 3)),
        np.random.default_rng(1).random((7, 3)) * 255.0,
    ],
)
def test_colors_are_no_normals(tmp_path, colors):
    np.savetxt(tmp_path / "a.xyz", np.hstack([POINTS, colors]), fmt="%.9g")
    cloud = read_cloud(tmp_path / "a.xyz")
    assert cloud.normals is None
    assert cloud.points == pytest.approx(POINTS)


def test_normals_that_all_point_up_are_no_colors(tmp_path):
    normals = np.random.default_rng(1).random((7, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.savetxt(tmp_path / "a.xyz", np.hstack([POINTS, normals]), fmt="%.2f")
    assert read_cloud(tmp_path / "a.xyz").normals == pytest.approx(normals, abs=0.01)


def test_a_header_may_leave_out_what_follows_from_the_rest(tmp_path):
    rows = "\n".join(" ".join(map(str, point)) for point in POINTS.tolist())
    (tmp_path / "a.pcd").write_text(f"COLUMNS x y z\nWIDTH 7\nHEIGHT 1\nDATA ascii\n{rows}\n")
    cloud = read_cloud(tmp_path / "a.pcd")
    assert cloud.points == pytest.approx(POINTS)
    assert cloud.camera is None


def test_a_missing_file_and_a_folder(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_cloud(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(InputError, match="no regular file"):
        read_cloud(tmp_path / "folder.ply")


def test_arrays_of_another_name(tmp_path):
    np.savez(tmp_path / "a.npz", xyz=POINTS)
    with pytest.raises(InputError, match="it holds xyz"):
        read_cloud(tmp_path / "a.npz")
