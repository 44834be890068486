"""URDF files as robots have them: meshes of packages, in several formats, visuals that nothing can read."""

import numpy as np
import pytest
import trimesh

from surehold.errors import InputError
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.proposal import propose_hand

CONFIG = HandConfig.model_validate(
    {
        "name": "own",
        "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
        "fingers": {"left": ["a1"], "right": ["c1"]},
        "preshapes": {"close": {"closed": {"a1": 1.2, "c1": 1.2}}},
    }
)


def urdf(geometry, more=""):
    link = (
        '<link name="{0}"><visual><geometry><mesh filename="package://nobody/looks.dae"/></geometry></visual>'
        '<collision><origin xyz="0 0 .03"/><geometry>{1}</geometry></collision></link>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="palm"/><child link="{1}"/><origin xyz="{2} 0 0"/>'
        '<axis xyz="0 {3} 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>'
    )
    box = '<box size=".02 .016 .06"/>'
    return (
        f'<robot name="gripper">{more}'
        + link.format("palm", '<box size=".04 .08 .02"/>')
        + link.format("l", geometry)
        + link.format("r", box)
        + joint.format("a1", "l", "-.04", 1)
        + joint.format("c1", "r", ".04", -1)
        + "</robot>"
    )


def written(tmp_path, name, text):
    path = tmp_path / "hand_description" / "urdf" / "hand.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh = path.parents[1] / name
    mesh.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((0.02, 0.016, 0.06)).export(mesh)
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("file", "name", "more"),
    [
        ("meshes/box.stl", "package://hand_description/meshes/box.stl", ""),
        ("meshes/box.obj", "package://another_name/meshes/box.obj", ""),
        ("meshes/box.ply", "../meshes/box.ply", ""),
        ("meshes/box.glb", "model://hand_description/meshes/box.glb", ""),
        ("urdf/a folder/box.stl", "box.stl", '<mujoco><compiler meshdir="a folder"/></mujoco>'),
        ("urdf/box.stl", "some/other/place/box.stl", ""),
    ],
)
def test_a_mesh_is_found_and_read(tmp_path, file, name, more):
    """A box as a mesh is covered as the box itself is, up to its pieces along the axis."""
    path = written(tmp_path, file, urdf(f'<mesh filename="{name}"/>', more))
    hand = load_hand(path, CONFIG)
    named = np.array(hand.link_names).reshape(hand.radii.shape)
    assert set(hand.radii[0][hand.radii[0] > 0.0].round(6)) == {0.008}
    reach = [np.abs(hand.chains[f, :, 1:7][named[f] == body]).max() for f, body in ((0, "l"), (1, "r"))]
    assert reach[0] == pytest.approx(reach[1], abs=1e-5)


def test_a_mesh_by_its_whole_path_and_scaled(tmp_path):
    path = written(tmp_path, "box.stl", "")
    where = (path.parents[1] / "box.stl").as_uri()
    path.write_text(urdf(f'<mesh filename="{where}" scale=".5 .5 .5"/>'))
    hand = load_hand(path, CONFIG)
    assert set(hand.radii[0][hand.radii[0] > 0.0].round(6)) == {0.004}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("package://hand_description/meshes/none.stl", ("none.stl' is not beside the file or above it", "first tried")),
        ("https://example.org/box.stl", ("is not on this disk", "nothing is fetched")),
        ("file:///nowhere/box.stl", ("is not there",)),
        ("../kept.dae", ("kept.dae", "save it as one of stl, obj")),
        ("../pointer.stl", ("pointer of Git LFS",)),
        ("", ("is not beside the file",)),
    ],
)
def test_a_mesh_that_is_none(tmp_path, name, words):
    path = written(tmp_path, "box.stl", urdf(f'<mesh filename="{name}"/>'))
    (path.parents[1] / "kept.dae").write_text("<COLLADA/>")
    (path.parents[1] / "pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    with pytest.raises(InputError) as error:
        load_hand(path, CONFIG)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="r">&a;</robot>', "defines entities"),
        (
            '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="m"/></robot>',
            "xacro hand.urdf > plain.urdf",
        ),
        ("<robot", "not a model that MuJoCo can read"),
    ],
)
def test_a_file_that_is_none(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        load_hand(written(tmp_path, "box.stl", text), CONFIG)


@pytest.mark.parametrize("leader", ["a2", "", "c1"])
def test_a_joint_that_mimics_none_is_refused(tmp_path, leader):
    """MuJoCo passes over such a mimic, and half of a gripper stayed where it was."""
    text = urdf('<box size=".02 .016 .06"/>').replace("</joint></robot>", f'<mimic joint="{leader}"/></joint></robot>')
    path = written(tmp_path, "meshes/box.stl", text)
    with pytest.raises(InputError, match=f"joint 'c1' mimics '{leader}': .*a1"):
        load_hand(path, CONFIG)


@pytest.mark.parametrize(("limits", "expected"), [('upper="1.2"', (0.0, 1.2)), ('lower="-1.2"', (-1.2, 0.0))])
def test_a_limit_that_is_left_out_is_zero(tmp_path, limits, expected):
    """As URDF has it; MuJoCo takes the joint as one without limits, and it opened and closed beyond its end."""
    text = urdf('<box size=".02 .016 .06"/>').replace('lower="0" upper="1.5"', limits, 1)
    assert propose_hand(written(tmp_path, "meshes/box.stl", text)).ranges["a1"] == expected


@pytest.mark.parametrize("limits", ['lower="1.5" upper="0"', 'lower="0" upper="nan"', 'lower="0" upper="90 deg"'])
def test_limits_that_are_none_are_refused(tmp_path, limits):
    """MuJoCo takes a joint whose limits are exchanged as one without limits."""
    text = urdf('<box size=".02 .016 .06"/>').replace('lower="0" upper="1.5"', limits, 1)
    with pytest.raises(InputError, match=r"joint 'a1' has the limits .* the lower one first"):
        load_hand(written(tmp_path, "meshes/box.stl", text), CONFIG)


def test_limits_of_a_continuous_joint_do_not_matter(tmp_path):
    text = (
        urdf('<box size=".02 .016 .06"/>')
        .replace('"revolute"', '"continuous"', 1)
        .replace('upper="1.5"', 'upper="-1"', 1)
    )
    assert propose_hand(written(tmp_path, "meshes/box.stl", text)).ranges["a1"] == (-np.pi, np.pi)


def test_two_joints_of_one_name_are_refused(tmp_path):
    """MuJoCo leaves the second without a name."""
    text = urdf('<box size=".02 .016 .06"/>').replace('"c1"', '"a1"')
    with pytest.raises(InputError, match="has 2 joints 'a1'; give each a name of its own"):
        load_hand(written(tmp_path, "meshes/box.stl", text), CONFIG)


def test_limits_in_degrees_are_refused(tmp_path):
    path = written(tmp_path, "meshes/box.stl", urdf('<box size=".02 .016 .06"/>').replace('"1.5"', '"85.9"'))
    with pytest.raises(
        InputError, match=r"'a1' of .* turns from 0 to 85.9 rad, several turns; are its limits in degrees"
    ):
        propose_hand(path)


def test_limits_of_two_turns_as_programs_round_them_are_no_degrees(tmp_path):
    turns = urdf('<box size=".02 .016 .06"/>').replace('"0" upper="1.5"', '"-6.28318530718" upper="6.28318530718"')
    assert propose_hand(written(tmp_path, "meshes/box.stl", turns))
