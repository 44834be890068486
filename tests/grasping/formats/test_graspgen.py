"""GraspGen files: transforms as their reader takes them, round trips, and what is refused."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.formats import GraspFile, StoredGrasp, read_grasps
from surehold.grasping.formats.graspgen import write_graspgen_file


def some(n=4):
    rng = np.random.default_rng(1)
    grasps = []
    for i, turn in enumerate(Rotation.random(n, rng=rng)):
        w, *xyz = turn.as_quat(canonical=True, scalar_first=True).tolist()
        grasps.append(StoredGrasp(f"g{i}", float(i > 0) * 0.5, tuple(rng.normal(size=3).tolist()), (w, *xyz)))
    return tuple(grasps)


def test_a_file_comes_back(tmp_path):
    told = GraspFile("mug", "", some(), "mug.obj", 0.25, settings={"contact": "single", "friction": 0.7})
    write_graspgen_file(tmp_path / "g.json", told)
    back = read_grasps(tmp_path / "g.json")
    assert (back.object_frame, back.object_file, back.object_scale) == ("mug", "mug.obj", 0.25)
    assert back.settings == told.settings
    for a, b in zip(told.grasps, back.grasps, strict=True):
        assert (a.name, a.confidence) == (b.name, b.confidence)
        assert a.position == pytest.approx(b.position, abs=1e-15)
        assert a.orientation == pytest.approx(b.orientation, abs=1e-12)


def test_transforms_are_those_of_the_reader(tmp_path):
    write_graspgen_file(tmp_path / "g.json", GraspFile("mug", "", some(), "mug.obj"))
    raw = json.loads((tmp_path / "g.json").read_text())
    transforms, mask = np.array(raw["grasps"]["transforms"]), np.array(raw["grasps"]["object_in_gripper"])
    assert (transforms.shape, mask.dtype, mask.tolist()) == ((4, 4, 4), bool, [False, True, True, True])
    for grasp, transform in zip(some(), transforms, strict=True):
        expected = Rotation.from_quat(grasp.orientation, scalar_first=True).as_matrix()
        np.testing.assert_allclose(transform[:3, :3], expected, atol=1e-12)
        np.testing.assert_allclose(transform[:, 3], [*grasp.position, 1.0])


GOOD = {
    "object": {"file": "a.obj", "scale": 1.0},
    "grasps": {"transforms": [np.eye(4).tolist()], "object_in_gripper": [True]},
}


def test_the_file_of_another_generator_is_read(tmp_path):
    (tmp_path / "g.json").write_text(json.dumps(GOOD))
    (grasp,) = read_grasps(tmp_path / "g.json").grasps
    assert (grasp.name, grasp.confidence, grasp.joints) == ("grasp_0", 1.0, {})


@pytest.mark.parametrize(("success", "confidence"), [(True, 1.0), (False, 0.0), (1, 1.0), (0, 0.0)])
def test_success_may_be_counted(tmp_path, success, confidence):
    grasps = GOOD["grasps"] | {"object_in_gripper": [success]}
    (tmp_path / "g.json").write_text(json.dumps(GOOD | {"grasps": grasps}))
    assert read_grasps(tmp_path / "g.json").grasps[0].confidence == confidence


def test_a_rounded_transform_is_the_rotation_next_to_it(tmp_path):
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_rotvec([0.3, -0.9, 1.1]).as_matrix()
    transform[:3, 3] = 0.1, 0.2, 0.3
    grasps = GOOD["grasps"] | {"transforms": [np.round(transform, 4).tolist()]}
    (tmp_path / "g.json").write_text(json.dumps(GOOD | {"grasps": grasps}))
    (grasp,) = read_grasps(tmp_path / "g.json").grasps
    assert np.linalg.norm(grasp.orientation) == pytest.approx(1.0, abs=1e-12)
    turned = Rotation.from_quat(grasp.orientation, scalar_first=True) * Rotation.from_matrix(transform[:3, :3]).inv()
    assert turned.magnitude() < 1e-4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "not a GraspGen file"),
        ('{"grasps": {"transforms": [], "object_in_gripper": [true]}}', "not a GraspGen file"),
        ('{"grasps": {"transforms": [[1]], "object_in_gripper": [true]}}', "4 x 4"),
        (json.dumps(GOOD).replace("1.0, 0.0, 0.0, 0.0", "2.0, 0.0, 0.0, 0.0"), "no rotation"),
        (
            json.dumps(GOOD).replace("0.0, 0.0, 0.0, 1.0", "0.1, 0.2, 0.3, 1.0"),
            "last row .* is 0.1, 0.2, 0.3, 1; .*transposed",
        ),
        (json.dumps(GOOD).replace("[true]", '["yes"]'), "object_in_gripper of grasp 0 is 'yes'; give true or false"),
        (json.dumps(GOOD).replace("[true]", "[2]"), "object_in_gripper of grasp 0 is '2'"),
        (json.dumps(GOOD).replace("1.0, 0.0, 0.0, 0.0", "-1.0, 0.0, 0.0, 0.0"), "right-handed axes"),
        (json.dumps(GOOD).replace("1.0, 0.0, 0.0, 0.0", "NaN, 0.0, 0.0, 0.0"), "finite"),
        (json.dumps(GOOD).replace("1.0, 0.0, 0.0, 0.0", '"1", 0.0, 0.0, 0.0'), "must be a number"),
        (json.dumps(GOOD).replace('"scale": 1.0', '"scale": -1.0'), "object_scale is -1"),
        (json.dumps(GOOD).replace('"a.obj"', "7"), "object.file must be a text"),
        (json.dumps(GOOD | {"surehold": [1]}), "surehold must be a mapping of options, not a list of 1"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, words):
    (tmp_path / "g.json").write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_grasps(tmp_path / "g.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", ["names", "confidences", "postures"])
@pytest.mark.parametrize(("value", "words"), [([], "holds 0"), ([0.5, 0.5], "holds 2"), (0.5, "is float")])
def test_what_stands_beside_the_transforms_is_not_passed_over(tmp_path, key, value, words):
    """Confidences of another number of grasps were taken for 1, postures for 0."""
    grasps = {"transforms": [np.eye(4).tolist()], "object_in_gripper": [True], key: value}
    (tmp_path / "g.json").write_text(json.dumps({"grasps": grasps}))
    with pytest.raises(InputError, match=f"grasps.{key} {words}; give a list of 1"):
        read_grasps(tmp_path / "g.json")
