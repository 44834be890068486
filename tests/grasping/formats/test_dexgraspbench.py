"""DexGraspBench files: NumPy reads what is written, its pickles are read, and no pickle runs anything."""

import io
import os
import pickle
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.formats import GraspFile, StoredGrasp, read_grasps
from surehold.grasping.formats.dexgraspbench import write_dexgraspbench_files

JOINTS = ("a", "b", "c")
ZERO = np.array([0.0, 0, 0, 1, 0, 0, 0])


SETTINGS = {"contact": "single", "friction": 0.7}


def test_numpy_reads_what_is_written_and_it_comes_back(tmp_path):
    turn = (0.5, 0.5, -0.5, 0.5)
    opened, closed, squeeze = {"a": 0.0, "c": 0.1}, {"c": 0.3, "a": 0.2}, {"a": 0.25, "c": 0.35}
    grasp = StoredGrasp("one", 0.7, (0.1, 0.2, 0.3), turn, closed, opened, squeeze, -0.5, 0.06)
    write_dexgraspbench_files(tmp_path, GraspFile("mug", "", (grasp,), "objects/mug", 2.0, settings=SETTINGS), JOINTS)
    row = np.load(tmp_path / "one.npy", allow_pickle=True).item()
    np.testing.assert_array_equal(row["grasp_qpos"], [0.1, 0.2, 0.3, *turn, 0.2, 0.0, 0.3])  # by name, in the order
    np.testing.assert_array_equal(row["pregrasp_qpos"][7:], [0.0, 0.0, 0.1])
    np.testing.assert_array_equal(row["squeeze_qpos"][7:], [0.25, 0.0, 0.35])
    assert (row["obj_path"], row["obj_scale"], row["obj_pose"].tolist()) == ("objects/mug", 2.0, ZERO.tolist())
    back = read_grasps(tmp_path)
    assert (back.object_file, back.object_scale, back.gripper_frame) == ("objects/mug", 2.0, "")
    assert back.settings == SETTINGS
    (read,) = back.grasps
    assert read.joints == {"a": 0.2, "b": 0.0, "c": 0.3}
    assert read.pose.matrix == pytest.approx(grasp.pose.matrix)
    assert (read.confidence, read.posture, read.quality) == (0.7, -0.5, 0.06)


def test_no_grasp_is_written_over_another_whose_name_differs_in_signs_only(tmp_path):
    names = ["grasp 1", "grasp_1", "grasp.1", "grasp_1_2", "x" * 101, "x" * 102, "", "grasp"]
    grasps = [StoredGrasp(name, 0.5, (float(i), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for i, name in enumerate(names)]
    write_dexgraspbench_files(tmp_path, GraspFile("mug", "", tuple(grasps), "mug"), ())
    back = read_grasps(tmp_path).grasps
    assert sorted(grasp.position[0] for grasp in back) == list(range(len(names)))
    assert [grasp.position[0] for grasp in back if grasp.name == "grasp_1"] == [0.0]


def written(path, protocol=3, **changes):
    row = {
        "obj_pose": ZERO,
        "obj_scale": np.float64(0.06),
        "obj_path": "o",
        "grasp_qpos": np.r_[ZERO, 1, 2].astype("f4"),
    }
    array = np.empty((), dtype=object)
    array[()] = row | {"pregrasp_qpos": np.r_[ZERO, 0, 0].astype("f4")} | changes
    head = io.BytesIO()
    np.save(head, array, allow_pickle=True)
    size = 10 + struct.unpack("<H", head.getvalue()[8:10])[0]
    data = pickle.dumps(array, protocol=protocol)
    if protocol == 3:  # as NumPy 1 wrote it
        data = data.replace(b"numpy._core.", b"numpy.core.")
    path.write_bytes(head.getvalue()[:size] + data)
    return path


@pytest.mark.parametrize("protocol", [3, 4])
def test_files_of_others_are_read(tmp_path, protocol):
    turned, there = Rotation.from_rotvec([0.3, -0.2, 0.5]), np.array([0.3, 0.1, -0.2])
    w, *xyz = turned.as_quat(scalar_first=True)
    path = written(tmp_path / "7.npy", protocol, obj_pose=np.array([*there, w, *xyz]))
    file = read_grasps(path, ("x", "y"))
    (grasp,) = file.grasps
    assert (grasp.joints, grasp.pregrasp_joints, grasp.quality) == ({"x": 1.0, "y": 2.0}, {"x": 0.0, "y": 0.0}, None)
    assert (file.object_scale, file.object_file) == (0.06, "o")
    np.testing.assert_allclose(grasp.position, turned.inv().apply(-there), atol=1e-12)  # the hand seen from the object
    assert read_grasps(path).grasps[0].joints == {"0": 1.0, "1": 2.0}, "without a hand they have numbers"
    with pytest.raises(InputError, match="holds 2 joints, 3 are named"):
        read_grasps(path, ("x", "y", "z"))


def test_a_folder_is_read_in_order_and_holds_one_object(tmp_path):
    for i in (10, 9, 1):
        written(tmp_path / f"{i}.npy")
    assert [grasp.name for grasp in read_grasps(tmp_path).grasps] == ["1", "9", "10"]
    written(tmp_path / "11.npy", obj_scale=0.08)
    with pytest.raises(InputError, match="2 objects or sizes"):
        read_grasps(tmp_path)
    written(tmp_path / "11.npy", surehold={"friction": 0.7})
    with pytest.raises(InputError, match="made with different options"):
        read_grasps(tmp_path)
    assert read_grasps(tmp_path / "11.npy").settings == {"friction": 0.7}
    with pytest.raises(InputError, match=r"holds 0 \.npy files; give a folder of 1 to [0-9,]+\."):
        read_grasps((tmp_path / "empty").mkdir() or tmp_path / "empty")
    (tmp_path / "upper" / "grasps").mkdir(parents=True)
    written(tmp_path / "upper" / "grasps" / "0.npy")
    with pytest.raises(InputError, match=r"such as '.*grasps'"):
        read_grasps(tmp_path / "upper")


class Hostile:
    def __reduce__(self):
        return os.mkdir, ("hacked",)


def bomb(path, data):
    path.write_bytes(written(path).read_bytes().split(b"\x80\x03")[0] + data)
    return path


def test_nothing_of_a_pickle_is_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for protocol in (3, 4):
        with pytest.raises(InputError, match="which is not loaded"):
            read_grasps(written(tmp_path / "a.npy", protocol, evil=Hostile()))
    assert not (tmp_path / "hacked").exists()
    np.load(written(tmp_path / "a.npy", 3, evil=Hostile()), allow_pickle=True)
    assert (tmp_path / "hacked").exists(), "the pickle would have run"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "no grasp of DexGraspBench"),
        (b"\x80\x04N.", "no grasp_qpos"),
        (b"\x80\x04}r\xff\xff\xff\x7f.", "LONG_BINPUT"),  # would ask for 17 GB
        (b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\x0f.", "no grasp of DexGraspBench"),
        (b"\x80\x04\x95\xff\xff\xff\xff\xff\xff\xff\x0fN.", "no grasp of DexGraspBench"),
        (b"cos\nsystem\n(S'true'\ntR.", "no grasp of DexGraspBench"),
        (b"\x80\x03cnumpy\ndtype\nX\x02\x00\x00\x00U9\x85R.", "a kind that is no number"),
        (b"\x80\x02ccopyreg\n__newobj__\n.", "copyreg.__newobj__, which is not loaded"),
        (b"\x80\x04" + b"]" * 5000 + b"a" * 4999 + b".", "no grasp_qpos"),
    ],
)
def test_hostile_and_damaged_pickles_are_refused(tmp_path, data, words):
    with pytest.raises(InputError, match=words) as caught:
        read_grasps(bomb(tmp_path / "a.npy", data))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"grasp_qpos": np.zeros(3)}, "7 numbers of the pose"),
        ({"grasp_qpos": np.r_[ZERO, np.nan, 0]}, "finite"),
        ({"grasp_qpos": "x" * 9}, "7 numbers of the pose"),
        ({"grasp_qpos": np.zeros((9, 9))}, "must be a number"),
        ({"grasp_qpos": np.array([object()] * 9)}, "not loaded"),
        ({"obj_pose": np.zeros(7)}, "quaternion of length 1"),
        ({"obj_path": 3}, "obj_path is no text"),
        ({"obj_scale": "x"}, "obj_scale must be a number"),
        ({"joint_names": ["a", "a"]}, "holds 2 joints, 2 are named"),
    ],
)
def test_values_are_checked(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        read_grasps(written(tmp_path / "a.npy", **changes))


def test_other_arrays_and_large_files_are_refused(tmp_path):
    np.save(tmp_path / "numbers.npy", np.zeros(3))
    with pytest.raises(InputError, match="not a dictionary"):
        read_grasps(tmp_path / "numbers.npy")
    (tmp_path / "large.npy").write_bytes(bytes(2**20 + 1))
    with pytest.raises(InputError, match="larger than 1 MB"):
        read_grasps(tmp_path / "large.npy")
    with pytest.raises(InputError, match="no file of grasps"):
        read_grasps(tmp_path / "grasps.txt")


def test_joints_out_of_the_order_are_not_written(tmp_path):
    grasp = StoredGrasp("g", 1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), {"d": 1.0})
    with pytest.raises(InputError, match="a joint 'd'"):
        write_dexgraspbench_files(tmp_path / "out", GraspFile("o", "", (grasp,)), JOINTS)
    assert list((tmp_path / "out").iterdir()) == []
