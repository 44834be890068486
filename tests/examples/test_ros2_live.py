"""Tuning parameters of a node that runs, where ROS 2 is installed."""

import sys
import threading
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("std_srvs")


def test_parameters_are_set_and_a_topic_is_read(monkeypatch):
    from rclpy.executors import MultiThreadedExecutor
    from rclpy.node import Node
    from std_msgs.msg import Float64

    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples" / "ros2" / "surehold_ros"))
    from surehold_ros.tuner import Metric, NodeParameters
    from surehold_ros.tuning import by_node, measured

    rclpy.init()
    try:
        controller, tuner = Node("controller"), Node("tuner")
        gain, steps = controller.declare_parameter("gain", 1.0), controller.declare_parameter("path.steps", 10)
        assert (gain.value, steps.value) == (1.0, 10)
        metric = controller.create_publisher(Float64, "metric", 10)
        controller.create_timer(
            0.02, lambda: metric.publish(Float64(data=-((controller.get_parameter("gain").value - 3.0) ** 2)))
        )
        executor = MultiThreadedExecutor(4)
        executor.add_node(controller)
        executor.add_node(tuner)
        threading.Thread(target=executor.spin, daemon=True).start()
        parameters, heard = NodeParameters(tuner), Metric(tuner, "metric")
        rounded = parameters.set(by_node({"/controller.gain": 2.0, "/controller.path.steps": 12.4}))
        assert rounded == {"/controller.path.steps": 12.0}
        assert controller.get_parameter("path.steps").value == 12
        time.sleep(0.3)
        assert measured(heard.during(1.0, threading.Event()), "mean") == pytest.approx(-1.0)
        with pytest.raises(RuntimeError, match="has not all of the parameters nothing"):
            parameters.set({"/controller": {"nothing": 1.0}})
        parameters.restore()
        assert (controller.get_parameter("gain").value, controller.get_parameter("path.steps").value) == (1.0, 10)
    finally:
        rclpy.try_shutdown()
        for name in [name for name in sys.modules if name.startswith("surehold_ros")]:
            del sys.modules[name]
