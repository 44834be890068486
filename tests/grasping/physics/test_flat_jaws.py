"""A gripper with flat pads: what its corners feel of thin walls, and squeezes that balance without it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.grasping import Pose, Simulator
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.mesh_files import load_mesh
from surehold.grasping.physics.check import GraspChecker

trimesh = pytest.importorskip("trimesh")

PAD = '<geom type="box" size=".006 .010 .035" pos="0 0 .036"/>'
JAWS = f"""
<mujoco><worldbody><body name="palm"><geom type="box" size=".05 .04 .02" pos="0 0 -.02"/>
  <body name="l" pos="-.045 0 0"><joint name="a" type="slide" axis="1 0 0" range="0 .05"/>{PAD}</body>
  <body name="r" pos=".045 0 0"><joint name="b" type="slide" axis="-1 0 0" range="0 .05"/>{PAD}</body>
</body></worldbody></mujoco>
"""


@pytest.fixture
def jaws(tmp_path):
    (tmp_path / "jaws.xml").write_text(JAWS)
    config = {
        "name": "jaws",
        "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
        "fingers": {"left": ["a"], "right": ["b"]},
        "finger_force": 20,
        "preshapes": {"power": {"open": {}, "closed": {"a": 0.045, "b": 0.045}}},
    }
    return load_hand(tmp_path / "jaws.xml", HandConfig.model_validate(config))


@pytest.fixture
def box(tmp_path, monkeypatch):
    pytest.importorskip("igl")
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))

    def made(*edges):
        trimesh.creation.box(edges).export(tmp_path / "box.stl")
        return load_mesh(tmp_path / "box.stl", unit="m").object

    return made


@pytest.mark.parametrize("thickness", [0.001, 0.002, 0.003])
def test_one_pad_on_one_side_of_a_plate_is_no_grasp(jaws, box, thickness):
    """Its corners stand out beyond the plate, and felt the far side from behind: force closure by one finger."""
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix()
    place = np.array([0.03, 0.0, 0.0]) - turn @ [0.0, 0.0, 0.06]
    pose = Pose.from_matrix(np.column_stack([turn, place]))
    grasp = Simulator(jaws, box(thickness, 0.1, 0.1), friction=0.5).grasp(pose)
    assert grasp.touching == ("l",)
    assert grasp.quality == 0.0
    assert np.all(grasp.contacts.normals[:, 0] > -0.1), "none pushes back"


def test_two_pads_on_both_sides_of_a_plate_are_one(jaws, box):
    grasp = Simulator(jaws, box(0.003, 0.06, 0.06), friction=0.5).grasp(Pose((0.0, 0.0, -0.06)))
    assert set(grasp.touching) == {"l", "r"}
    assert grasp.quality > 0.1
    assert {-1.0, 1.0} <= set(np.round(grasp.contacts.normals[:, 0]).tolist())


def test_quality_does_not_hang_on_where_the_nodes_of_the_grid_lie(jaws, box):
    """By default they lie on the faces of this box; with the other cell on none."""
    cube = box(0.03, 0.03, 0.03)
    apart = replace(cube, distances=distance_field_of(cube, 0.00097, margin=0.02))
    qualities = [
        Simulator(jaws, obj, friction=0.5).grasp(Pose((x, y, -0.05))).quality
        for obj in (cube, apart)
        for x, y in ((0.0, 0.0), (0.004, -0.0004), (0.0, 0.0065))
    ]
    assert min(qualities) > 0.1
    np.testing.assert_allclose(qualities[:3], qualities[3:], rtol=0.01)


@pytest.mark.parametrize("friction", [0.5, 8.0, 10.0])
def test_a_squeeze_never_opens_the_hand(jaws, box, friction):
    """At a friction of 8 one pad's forces balance by themselves; rounding was scaled up to the whole torque."""
    simulator = Simulator(jaws, box(0.03, 0.03, 0.03), friction=friction)
    checker = GraspChecker(simulator, mass=0.03)
    grasp = simulator.grasp(Pose((0.0, 0.0, -0.05)))
    assert np.all(checker._beyond(grasp) > 0.0)
    assert checker.check(grasp).verdict == "held"


def test_the_check_weighs_the_object_at_its_center_of_mass(jaws, box):
    stick = replace(box(0.02, 0.3, 0.02), mass=0.5, center_of_mass=np.array([0.0, 0.14, 0.0]))
    simulator = Simulator(jaws, stick, friction=0.5)
    checker = GraspChecker(simulator)
    verdicts = [checker.check(simulator.grasp(Pose((0.0, y, -0.05)))).verdict for y in (0.12, 0.0)]
    assert verdicts == ["held", "dropped"], "near the mass, and 140 mm away from it"


@pytest.mark.parametrize("edge", [0.006, 0.012])
@pytest.mark.parametrize("mass", [0.0002, 0.002, 0.02])
def test_strong_fingers_do_not_sink_through_what_is_light(jaws, box, edge, mass):
    """A hundred times its weight holds a cube, and its corners stay where they touch to a millimeter."""
    mujoco = pytest.importorskip("mujoco")
    simulator = Simulator(jaws, box(edge, edge, edge), friction=0.5)
    checker = GraspChecker(simulator, mass=mass)
    grasp = simulator.grasp(Pose((0.0, 0.002, -0.05)))
    settled, data = checker._squeezed([grasp])[1][0], mujoco.MjData(checker.model)
    mujoco.mj_setState(checker.model, data, settled, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_forward(checker.model, data)
    assert data.ncon > 0
    assert np.all(data.contact.dist > -0.001)
    assert checker.check(grasp).verdict == "held"
