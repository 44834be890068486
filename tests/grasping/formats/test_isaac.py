"""Isaac grasp files and plain dictionaries."""

import json
import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest
import yaml

from surehold.errors import InputError
from surehold.grasping.formats import (
    GraspFile,
    StoredGrasp,
    grasp_to_dict,
    read_isaac_grasps,
    write_isaac_grasps,
)
from surehold.grasping.formats.isaac import write_isaac_file
from surehold.grasping.wrench.wrench_space import wrench_quality

HEADER = "format: isaac_grasp\nformat_version: 1.0\nobject_frame: mug\ngripper_frame: hand\n"
# layout of the published specification; Isaac Sim appends _link to the names of the frames
PUBLISHED = """format: isaac_grasp
format_version: 1.0

object_frame_link: /World/mug
gripper_frame_link: /World/panda_hand

grasps:
  "grasp_0":
    confidence: 1.0
    position: [-0.04346, 0.06759, 0.19895]
    orientation: {w: 0.00332, xyz: [0.98453, 0.16837, 0.04837]}
    cspace_position:
      panda_finger_joint1: 0.00943
    pregrasp_cspace_position:
      panda_finger_joint1: 0.04
"""


def test_files_come_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(0)
    grasps = []
    for k in range(5):
        q = rng.normal(size=4)
        joints = {f"joint_{i}": float(rng.normal()) * 10.0 ** float(rng.integers(-9, 3)) for i in range(4)}
        opened = dict.fromkeys(joints, 0.0)
        position, q = tuple(rng.normal(size=3).tolist()), tuple((q / np.linalg.norm(q)).tolist())
        grasps.append(StoredGrasp(f"grasp_{k}", float(rng.uniform()), position, q, joints, opened))
    path = tmp_path / "grasps.yaml"
    write_isaac_grasps(path, grasps, "mug", "icub_left_palm")
    back = read_isaac_grasps(path)
    assert back.grasps == tuple(grasps)
    assert (back.object_frame, back.gripper_frame) == ("mug", "icub_left_palm")
    raw = yaml.safe_load(path.read_text())  # what another reader sees
    assert (raw["format"], raw["format_version"]) == ("isaac_grasp", 1.0)
    first = raw["grasps"]["grasp_0"]
    assert set(first) == {"confidence", "position", "orientation", "cspace_position", "pregrasp_cspace_position"}
    assert first["orientation"]["xyz"] == list(grasps[0].orientation[1:])


def test_the_published_layout_is_read(tmp_path):
    path = tmp_path / "mug.yaml"
    path.write_text(PUBLISHED)
    file = read_isaac_grasps(path)
    (grasp,) = file.grasps
    assert (file.object_frame, file.gripper_frame) == ("/World/mug", "/World/panda_hand")
    assert grasp.orientation == (0.00332, 0.98453, 0.16837, 0.04837)
    assert grasp.joints == {"panda_finger_joint1": 0.00943}
    assert grasp.pregrasp_joints == {"panda_finger_joint1": 0.04}


GRASP = "grasps:\n  g: {{confidence: {c}, position: {p}, orientation: {{w: 1, xyz: {o}}}, cspace_position: {j}}}\n"


def grasp_text(c="1", p="[0, 0, 0]", o="[0, 0, 0]", j="{}"):
    return HEADER + GRASP.format(c=c, p=p, o=o, j=j)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not an Isaac grasp file"),
        ("[1, 2]", "not an Isaac grasp file"),
        ("format: other", "not an Isaac grasp file"),
        ("format: isaac_grasp\nformat_version: 2.0\n", "version 1.0 is supported"),
        (HEADER, "'grasps' must map"),
        (HEADER + "grasps: [1]", "'grasps' must map"),
        (HEADER + "grasps: {g: 1}", "must be a mapping"),
        (HEADER + "grasps: {g: {confidence: 1}}", "has no 'position'"),
        (HEADER + "grasps: {g: {confidence: 1, position: [0, 0, 0], orientation: [1, 0]}}", "orientation must be"),
        (grasp_text(c="1.5"), "confidence must be in"),
        (grasp_text(c="yes"), "must be a number"),
        (grasp_text(p="[0, 0]"), "must hold 3 numbers"),
        (grasp_text(p="[0, .nan, 0]"), "finite"),
        (grasp_text(o="[1, 0, 0]"), "length 1"),
        (grasp_text(j="[1]"), "joint"),
        (grasp_text(j="{a: b}"), "joint 'a'"),
        (grasp_text(j="{a: 1, a: 2}"), "given twice"),
        (grasp_text() + "x: &a [1]\ny: *a\n", "aliases"),
        (HEADER + "grasps: !!python/object/apply:os.system ['true']", "not plain YAML"),
        (HEADER + "grasps: {", "not plain YAML"),
        ("[" * 5000, "not plain YAML"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_isaac_grasps(path)
    assert "\n" not in str(caught.value)


def test_unreadable_and_unwritable_places(tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        read_isaac_grasps(tmp_path / "missing.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="UTF-8"):
        read_isaac_grasps(tmp_path / "binary.yaml")
    with pytest.raises(InputError, match="cannot be written"):
        write_isaac_grasps(tmp_path / "no folder" / "x.yaml", [], "mug", "hand")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"confidence": float("nan")}, "finite"),
        ({"orientation": (2.0, 0.0, 0.0, 0.0)}, "length 1"),
        ({"position": (0.0, 0.0)}, "3 numbers"),
        ({"joints": {"a": "b"}}, "number"),
    ],
)
def test_bad_grasps_are_not_written(tmp_path, change, words):
    given = {"name": "g", "confidence": 1.0, "position": (0.0, 0.0, 0.0), "orientation": (1.0, 0.0, 0.0, 0.0)} | change
    with pytest.raises(InputError, match=words):
        write_isaac_grasps(tmp_path / "g.yaml", [StoredGrasp(**given)], "mug", "hand")
    assert not (tmp_path / "g.yaml").exists()


def test_a_name_twice_is_refused(tmp_path):
    grasp = StoredGrasp("g", 1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="twice"):
        write_isaac_grasps(tmp_path / "g.yaml", [grasp, grasp], "mug", "hand")


def test_records_become_plain_json():
    class Pair(NamedTuple):
        a: int
        b: float

    @dataclass(frozen=True)
    class Record:
        points: np.ndarray
        pair: Pair
        flag: np.bool_

    data = grasp_to_dict(Record(np.array([[1.0, np.nan]]), Pair(np.int64(1), np.float32(0.5)), np.True_))
    assert json.loads(json.dumps(data, allow_nan=False)) == {
        "points": [[1.0, None]],
        "pair": {"a": 1, "b": 0.5},
        "flag": True,
    }
    with pytest.raises(InputError, match="no form in JSON"):
        grasp_to_dict({"f": object()})


def test_a_quality_is_stored_without_its_wrenches():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
    quality = wrench_quality(corners, -corners)
    data = json.loads(json.dumps(grasp_to_dict(quality), allow_nan=False))
    assert data["epsilon"] == quality.epsilon
    assert data["weakest"] == quality.weakest.tolist()
    assert "wrenches" not in data


def test_what_is_said_of_object_gripper_and_options_comes_back(tmp_path):
    grasp = StoredGrasp("g", 0.5, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), {"a": 1.0}, {"a": 0.0}, {}, -0.7, 0.123)
    told = GraspFile("mug", "palm", (grasp,), "mug.obj", 0.001, "hand.xml", ("l", "r"), "upper", {"object": "mug"})
    write_isaac_file(tmp_path / "g.yaml", told)
    assert read_isaac_grasps(tmp_path / "g.yaml") == told
    raw = yaml.safe_load((tmp_path / "g.yaml").read_text())
    assert isinstance(raw["format_version"], float), "Isaac Sim takes the difference from 1.0"
    assert {"object_file", "object_scale", "gripper_file", "finger_colliders", "open_limit"} <= set(raw)


def test_the_file_of_another_generator_is_read(tmp_path):
    text = PUBLISHED.replace("1.0\n", '"1.0"\n', 1).replace("    confidence: 1.0\n", "")
    (tmp_path / "g.yaml").write_text("created_with: grasp_guess\nobject_scale: 0.5\nbite_body_idx: 3\n" + text)
    file = read_isaac_grasps(tmp_path / "g.yaml")
    assert (file.object_scale, file.grasps[0].confidence, file.grasps[0].quality) == (0.5, 1.0, None)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("object_scale: 0\n", "object_scale is 0.0"),
        ("object_scale: x\n", "object_scale must be a number"),
        ("object_file: [1]\n", "object_file must be a text"),
        ("finger_colliders: a\n", "finger_colliders must be a list"),
        ("surehold: 1\n", "surehold must be a mapping"),
    ],
)
def test_what_is_said_beside_the_grasps_is_checked(tmp_path, text, words):
    (tmp_path / "g.yaml").write_text(text + grasp_text())
    with pytest.raises(InputError, match=words):
        read_isaac_grasps(tmp_path / "g.yaml")


def test_a_pipe_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(InputError, match="no regular file"):
        read_isaac_grasps(tmp_path / "pipe.yaml")
