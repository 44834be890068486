"""The node: an Explore action, and Ask and Tell services, on a study that `surehold study serve` serves.

The robot answers the service `make_trial`. Parameters: address, study, token (or the environment's SUREHOLD_TOKEN),
robot.
"""

import os
import threading
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from surehold_interfaces.action import Explore
from surehold_interfaces.srv import Ask, MakeTrial, Tell

from surehold_ros.client import Refused, StudyClient
from surehold_ros.exploration import Made, explore


class Explorer(Node):
    """Explores with a study."""

    def __init__(self) -> None:
        super().__init__("explorer")
        address = self.declare_parameter("address", "http://127.0.0.1:8765").value
        study = self.declare_parameter("study", "study").value
        token = self.declare_parameter("token", "").value or os.environ.get("SUREHOLD_TOKEN", "")
        self._robot = self.declare_parameter("robot", self.get_name()).value
        self._client = StudyClient(address, study, token)
        self._exploring = threading.Lock()
        self.create_service(Ask, "ask", self._ask, callback_group=MutuallyExclusiveCallbackGroup())
        self.create_service(Tell, "tell", self._tell, callback_group=MutuallyExclusiveCallbackGroup())
        self._make = self.create_client(MakeTrial, "make_trial", callback_group=MutuallyExclusiveCallbackGroup())
        self._action = ActionServer(
            self,
            Explore,
            "explore",
            self._explore,
            goal_callback=lambda _: GoalResponse.REJECT if self._exploring.locked() else GoalResponse.ACCEPT,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _ask(self, request: Ask.Request, response: Ask.Response) -> Ask.Response:
        try:
            asked = self._client.ask(request.robot or self._robot)
        except (Refused, OSError) as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.id, response.again = True, asked["id"], asked["again"]
        response.names, response.values, response.units = _columns(asked)
        return response

    def _tell(self, request: Tell.Request, response: Tell.Response) -> Tell.Response:
        reached = dict(zip(request.reached_names, request.reached_values, strict=False))
        try:
            told = self._client.tell(request.id, request.value, failed=request.failed, reached=reached)
        except (Refused, OSError, ValueError) as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.already = True, told["already"]
        return response

    def _explore(self, goal: Any) -> Explore.Result:
        result = Explore.Result()
        with self._exploring:

            def progress(made: int, asked: dict[str, Any], outcome: Made) -> None:
                feedback = Explore.Feedback(made=made, id=asked["id"], value=outcome.value, failed=outcome.failed)
                goal.publish_feedback(feedback)

            try:
                result.made, result.stopped = explore(
                    self._client,
                    self._robot,
                    self._make_trial,
                    trials=goal.request.trials,
                    progress=progress,
                    cancelled=lambda: goal.is_cancel_requested or not rclpy.ok(),
                )
                best = self._client.recommendation()
            except (Refused, OSError, RuntimeError) as error:
                result.stopped = str(error)
                goal.abort()
                return result
        result.names, result.values = list(best["parameters"]), [float(v) for v in best["parameters"].values()]
        result.mean, result.quantile = best["mean"], best["quantile"]
        goal.canceled() if goal.is_cancel_requested else goal.succeed()
        return result

    def _make_trial(self, asked: dict[str, Any]) -> Made:
        """Have the robot make a trial; the executor's other threads carry the answer here."""
        if not self._make.wait_for_service(timeout_sec=30.0):
            raise RuntimeError("nobody answers the service make_trial; the trial is handed out again at the next start")
        request = MakeTrial.Request(id=asked["id"])
        request.names, request.values, request.units = _columns(asked)
        done = threading.Event()
        future = self._make.call_async(request)
        future.add_done_callback(lambda _: done.set())
        while not done.wait(0.5):
            if not rclpy.ok():
                raise RuntimeError("the node ends; the trial is handed out again at the next start")
        answer = future.result()
        reached = dict(zip(answer.reached_names, answer.reached_values, strict=False))
        return Made(answer.value, answer.failed, reached)


def _columns(asked: dict[str, Any]) -> tuple[list[str], list[float], list[str]]:
    names = list(asked["parameters"])
    return names, [float(asked["parameters"][n]) for n in names], [asked["units"].get(n, "") for n in names]


def main() -> None:
    """Run the node."""
    rclpy.init()
    executor = MultiThreadedExecutor()
    executor.add_node(Explorer())
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
