"""The nodes of the ROS 2 example, with classes made of the interfaces' definitions in the place of ROS."""

import importlib
import sys
import threading
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.grasping.formats import StoredGrasp, write_isaac_grasps
from tests.examples import ros2_interfaces

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2"


class Node:
    """What the nodes use of rclpy's; `others` are the nodes that run, name -> parameters."""

    given: ClassVar[dict] = {}
    others: ClassVar[dict] = {}
    log: ClassVar[list] = []

    def __init__(self, name):
        self.name, self.services, self.subscriptions = name, {}, {}
        self._parameters = {}  # rclpy keeps its own there

    def declare_parameter(self, name, default):
        self._parameters[name] = self.given.get(name, default)
        return SimpleNamespace(value=self._parameters[name])

    def get_logger(self):
        return SimpleNamespace(error=self.log.append)

    def create_service(self, kind, name, callback, callback_group):
        self.services[name] = (kind, callback)

    def create_subscription(self, kind, topic, callback, depth, callback_group):
        self.subscriptions[topic] = (kind, callback)

    def create_client(self, kind, name, callback_group):
        return Client(kind, name, self.others)


class Client:
    """A client of a service of a node that runs."""

    def __init__(self, kind, name, others):
        self.kind, (self.node, _, self.what), self.others = kind, name.rpartition("/"), others

    def wait_for_service(self, timeout_sec):
        return self.node in self.others

    def call_async(self, request):
        assert isinstance(request, self.kind.Request)
        answer, values = self.kind.Response(), self.others[self.node]
        if self.what == "get_parameters":
            answer.values = [value_of(values.get(name)) for name in request.names]
        elif self.what == "set_parameters_atomically":
            new = {p.name: python_of(p.value) for p in request.parameters}
            good = all(type(new[name]) is type(values[name]) for name in new) and values.get("gain", 0.0) < 100.0
            answer.result.successful, answer.result.reason = good, "" if good else "wrong type"
            if good:
                values.update(new)
        else:
            answer.success, answer.message = values["go"], "" if values["go"] else "emergency stop"
        return SimpleNamespace(add_done_callback=lambda done: done(None), result=lambda: answer)


def value_of(value):
    kind = sys.modules["rcl_interfaces.msg"].ParameterValue
    names = {bool: (1, "bool_value"), int: (2, "integer_value"), float: (3, "double_value")}
    if value is None:
        return kind()
    number, field = names[type(value)]
    return kind(**{"type": number, field: value})


def python_of(value):
    return [None, value.bool_value, value.integer_value, value.double_value][value.type]


class Parameter:
    def __init__(self, name, value):
        self.name, self.value = name, value

    def to_parameter_msg(self):
        return sys.modules["rcl_interfaces.msg"].Parameter(name=self.name, value=value_of(self.value))


@pytest.fixture
def ros(monkeypatch):
    own = {
        f"surehold_interfaces/{file.parent.name}/{file.stem}": file.read_text()
        for file in (EXAMPLE / "surehold_interfaces").glob("*/*.*")
    }
    ros2_interfaces.install(monkeypatch, own)
    made = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.action": {"ActionServer": lambda *arguments: SimpleNamespace(arguments=arguments)},
        "rclpy.callback_groups": {"MutuallyExclusiveCallbackGroup": object, "ReentrantCallbackGroup": object},
        "rclpy.executors": {"MultiThreadedExecutor": object},
        "rclpy.parameter": {"Parameter": Parameter, "parameter_value_to_python": python_of},
        "rclpy.signals": {"SignalHandlerOptions": object},
    }
    for name, content in made.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(EXAMPLE / "surehold_ros"))
    Node.given, Node.others, Node.log = {}, {}, []
    yield lambda name: importlib.import_module(f"surehold_ros.{name}")
    for name in [name for name in sys.modules if name.startswith("surehold_ros")]:
        del sys.modules[name]


class Goal:
    def __init__(self, obj):
        self.request = sys.modules["grasping_msgs.action"].GraspPlanning.Goal(object=obj, group_name="hand")
        self.said = []

    def publish_feedback(self, feedback):
        self.said.append(feedback)

    def abort(self):
        self.said.append("aborted")

    def succeed(self):
        self.said.append("succeeded")


def test_grasps_are_planned_from_a_stored_result(ros, tmp_path):
    turns = Rotation.random(3, rng=np.random.default_rng(0))
    stored = [
        StoredGrasp(f"g{i}", worth, (0.1 * i, 0.2, -0.1), tuple(q), {"a": 0.5, "b": 0.2}, {"a": 0.0, "b": 0.1})
        for i, (worth, q) in enumerate(zip((0.3, 0.0, 0.6), turns.as_quat(scalar_first=True).tolist(), strict=True))
    ]
    write_isaac_grasps(tmp_path / "grasps.yaml", stored, "mug", "palm")
    Node.given = {"files": [str(tmp_path / "grasps.yaml")], "max_contact_force": 8.0}
    planner = ros("grasp_planner").GraspPlanner()
    msgs = sys.modules["geometry_msgs.msg"]
    at = Rotation.from_rotvec([0.2, 0.5, -0.3])
    x, y, z, w = at.as_quat().tolist()
    pose = msgs.Pose(position=msgs.Point(x=1.0, y=2.0, z=3.0), orientation=msgs.Quaternion(x=x, y=y, z=z, w=w))
    wanted = sys.modules["grasping_msgs.msg"].Object(name="mug", mesh_poses=[pose])
    wanted.header.frame_id = "table"
    goal = Goal(wanted)
    result = planner.plan(goal)
    assert [g.id for g in result.grasps] == ["g2", "g0"], "best first; those of confidence 0 are no grasps"
    assert goal.said[-1] == "succeeded"
    assert goal.said[0].grasps == result.grasps
    first = result.grasps[0]
    assert (first.grasp_quality, first.max_contact_force, first.allowed_touch_objects) == (0.6, 8.0, ["mug"])
    p, q = first.grasp_pose.pose.position, first.grasp_pose.pose.orientation
    assert first.grasp_pose.header.frame_id == "table"
    np.testing.assert_allclose([p.x, p.y, p.z], at.apply(stored[2].position) + np.array([1, 2, 3]), atol=1e-12)
    found = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    np.testing.assert_allclose(found, (at * turns[2]).as_matrix(), atol=1e-12)
    assert first.grasp_posture.joint_names == ["a", "b"]
    assert first.grasp_posture.points[0].positions == [0.5, 0.2]
    assert first.pre_grasp_posture.points[0].positions == [0.0, 0.1]
    assert first.pre_grasp_approach.direction.header.frame_id == "palm"
    assert first.pre_grasp_approach.desired_distance == 0.1
    wanted.name = "cup"
    goal = Goal(wanted)
    assert planner.plan(goal).grasps == []
    assert goal.said == ["aborted"]
    assert "no grasp of 'cup' is stored; there are those of: mug" in Node.log[0]


def test_a_planner_without_grasps_says_so(ros, tmp_path):
    with pytest.raises(ValueError, match="names no file of grasps"):
        ros("grasp_planner").GraspPlanner()
    (tmp_path / "x.yaml").write_text("format: isaac_grasp\nformat_version: 2.0\ngrasps: {}\n")
    with pytest.raises(ValueError, match="format_version 2"):
        ros("stored_grasps").read(str(tmp_path / "x.yaml"))


def trial(ros, values, metric=(1.0, 3.0), **given):
    """Make a trial with the tuner while the metric says some numbers."""
    Node.given = {"settle": 0.0, "duration": 5.0} | given
    tuner = ros("tuner").Tuner()
    kind, make = tuner.services["make_trial"]
    number, take = tuner.subscriptions["metric"]
    listened = tuner._metric.during

    def during(seconds, over):
        assert seconds == 5.0
        take(number(data=99.0))  # before anybody listens: does not count
        over.set()
        telling = threading.Timer(0.0, lambda: None)
        telling.start()
        original = over.wait
        over.wait = lambda timeout: [take(number(data=value)) for value in metric] and original(0.0)
        return listened(seconds, over)

    tuner._metric.during = during
    request = kind.Request(id=1, names=list(values), values=list(values.values()), units=[""] * len(values))
    return tuner, make(request, kind.Response())


def test_a_trial_sets_parameters_and_reads_the_metric(ros):
    Node.others = {"/controller": {"gain": 1.0, "FollowPath.samples": 10, "smooth": False}}
    values = {"/controller.gain": 2.5, "controller.FollowPath.samples": 12.4, "/controller.smooth": 1.0}
    tuner, answer = trial(ros, values)
    assert (answer.value, answer.failed, answer.message) == (2.0, False, "")
    assert Node.others["/controller"] == {"gain": 2.5, "FollowPath.samples": 12, "smooth": True}
    assert dict(zip(answer.reached_names, answer.reached_values, strict=True)) == {
        "controller.FollowPath.samples": 12.0
    }
    tuner.end()
    assert Node.others["/controller"] == {"gain": 1.0, "FollowPath.samples": 10, "smooth": False}


@pytest.mark.parametrize(
    ("values", "others", "given", "metric", "words"),
    [
        ({"gain": 1.0}, {}, {}, (1.0,), "names no node"),
        ({"/c.gain": 1.0}, {}, {}, (1.0,), "nobody answers the service /c/get_parameters"),
        ({"/c.other": 1.0}, {"/c": {"gain": 1.0}}, {}, (1.0,), "has not all of the parameters other"),
        ({"/c.gain": 1.0}, {"/c": {"gain": 200.0}}, {}, (1.0,), "/c refuses"),
        ({"/c.gain": 1.0}, {"/c": {"gain": 1.0}}, {}, (1.0, float("nan")), "no finite number"),
        ({"/c.gain": 1.0}, {"/c": {"gain": 1.0}}, {}, (), "no finite number"),
        ({"/c.gain": 1.0}, {"/c": {"gain": 1.0}, "/robot": {"go": False}}, {"start": "/robot/go"}, (1.0,), "emergency"),
    ],
)
def test_a_trial_that_cannot_be_made_has_failed(ros, values, others, given, metric, words):
    Node.others = others
    _, answer = trial(ros, values, metric, **given)
    assert answer.failed
    assert words in answer.message


def test_measures(ros):
    measured = ros("tuning").measured
    values = [3.0, 1.0, 4.0]
    found = {name: measured(values, name) for name in ros("tuning").MEASURES}
    assert found == {"mean": 8 / 3, "median": 3.0, "min": 1.0, "max": 4.0, "last": 4.0, "sum": 8.0}
    with pytest.raises(ValueError, match="measure 'best' is unknown"):
        measured(values, "best")
