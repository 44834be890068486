"""A node that makes trials by setting parameters of running nodes: it answers `make_trial` for the explorer.

A trial's variables are called NODE.PARAMETER. The node sets them (rcl_interfaces/SetParametersAtomically), waits
`settle` seconds, calls the service `start` (std_srvs/Trigger) if one is named, listens to the topic `metric`
(std_msgs/Float64) for `duration` seconds, and answers with the `measure` of it: mean, median, min, max, last or sum. A
trial has failed if a node refuses, the start refuses, or no finite number comes. What the parameters were before is set
again when the node ends.
"""

import threading
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from surehold_ros.tuning import as_declared, by_node, measured


class NodeParameters:
    """Parameters of other nodes, set and read through a node whose executor has threads to spare."""

    def __init__(self, node: Any, patience: float = 10.0):
        self._node, self._patience = node, patience
        self._group = ReentrantCallbackGroup()
        self._clients: dict[tuple[str, str], Any] = {}
        self._before: dict[str, dict[str, Any]] = {}

    def set(self, wanted: dict[str, dict[str, float]]) -> dict[str, float]:
        """Set parameters of nodes, each node's at once; returns what was set where a type rounded it."""
        rounded = {}
        for node, values in wanted.items():
            now = self._get(node, list(values))
            kept = self._before.setdefault(node, {})
            chosen = {}
            for name, value in values.items():
                kept.setdefault(name, now[name])
                chosen[name] = as_declared(value, now[name])
                if float(chosen[name]) != value:
                    rounded[f"{node}.{name}"] = float(chosen[name])
            self._set(node, chosen)
        return rounded

    def restore(self) -> None:
        """Set what the parameters were before the first trial."""
        for node, values in self._before.items():
            self._set(node, values)

    def _get(self, node: str, names: list[str]) -> dict[str, Any]:
        answer = self.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names))
        values = [parameter_value_to_python(value) for value in answer.values]
        if len(values) != len(names) or None in values:
            raise RuntimeError(f"{node} has not all of the parameters {', '.join(names)}")
        return dict(zip(names, values, strict=True))

    def _set(self, node: str, values: dict[str, Any]) -> None:
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        answer = self.call(SetParametersAtomically, f"{node}/set_parameters_atomically", request)
        if not answer.result.successful:
            raise RuntimeError(f"{node} refuses {values}: {answer.result.reason}")

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service and wait for its answer; other threads of the executor carry it here."""
        key = (kind.__name__, name)
        if key not in self._clients:
            self._clients[key] = self._node.create_client(kind, name, callback_group=self._group)
        client = self._clients[key]
        if not client.wait_for_service(timeout_sec=self._patience):
            raise RuntimeError(f"nobody answers the service {name}")
        done = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        if not done.wait(self._patience):
            raise RuntimeError(f"the service {name} does not answer within {self._patience:g} s")
        return future.result()


class Metric:
    """The numbers of a topic while it is listened to."""

    def __init__(self, node: Any, topic: str):
        self._values: list[float] | None = None
        self._lock = threading.Lock()
        group = MutuallyExclusiveCallbackGroup()
        node.create_subscription(Float64, topic, self._take, 50, callback_group=group)

    def _take(self, message: Any) -> None:
        with self._lock:
            if self._values is not None:
                self._values.append(float(message.data))

    def during(self, seconds: float, over: threading.Event) -> list[float]:
        """Return what comes within so many seconds, or until the event."""
        with self._lock:
            self._values = []
        over.wait(seconds)
        with self._lock:
            values, self._values = self._values, None
        return values or []


class Tuner(Node):
    """Makes trials by setting parameters."""

    def __init__(self) -> None:
        super().__init__("tuner")
        from surehold_interfaces.srv import MakeTrial

        self._settle = float(self.declare_parameter("settle", 0.5).value)
        self._duration = float(self.declare_parameter("duration", 10.0).value)
        self._measure = str(self.declare_parameter("measure", "mean").value)
        self._start = str(self.declare_parameter("start", "").value)
        measured([0.0], self._measure)  # explains an unknown one at once
        self._tuned = NodeParameters(self)
        self._metric = Metric(self, str(self.declare_parameter("metric", "metric").value))
        self._over = threading.Event()
        group = MutuallyExclusiveCallbackGroup()
        self.create_service(MakeTrial, "make_trial", self.make, callback_group=group)

    def make(self, request: Any, response: Any) -> Any:
        """Make one trial."""
        try:
            rounded = self._tuned.set(by_node(dict(zip(request.names, request.values, strict=True))))
            self._over.wait(self._settle)
            if self._start:
                started = self._tuned.call(Trigger, self._start, Trigger.Request())
                if not started.success:
                    raise RuntimeError(f"{self._start} refuses: {started.message}")
            response.value = measured(self._metric.during(self._duration, self._over), self._measure)
        except (RuntimeError, ValueError) as error:
            self.get_logger().error(f"trial {request.id}: {error}")
            response.value, response.failed, response.message = float("nan"), True, str(error)
            return response
        response.failed = response.value != response.value
        response.message = "no finite number came from the metric" if response.failed else ""
        names = {name if name.startswith("/") else f"/{name}": name for name in request.names}
        response.reached_names = [names[name] for name in rounded]
        response.reached_values = list(rounded.values())
        return response

    def end(self) -> None:
        """Stop listening, and set what the parameters were before."""
        self._over.set()
        self._tuned.restore()


def main() -> None:
    """Run the node."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # what was set is set back before ROS ends
    executor = MultiThreadedExecutor()
    tuner = Tuner()
    executor.add_node(tuner)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    try:
        spinning.join()
    except KeyboardInterrupt:
        pass
    finally:
        tuner.end()
        rclpy.try_shutdown()
