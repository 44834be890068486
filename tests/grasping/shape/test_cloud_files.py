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
        ("a.pcd", pcd(b"", 7, "binary_compressed"), "pcl_convert_pcd_ascii_binary"),
        ("a.pcd", pcd(b"", 0, "binary"), "holds no points"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said) as error:
        read_cloud(tmp_path / name)
    assert "\n" not in str(error.value)


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
