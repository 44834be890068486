"""A node that answers `grasping_msgs/action/GraspPlanning` from stored grasps, for MoveIt's pick pipelines.

Parameters: files (grasps.yaml of `surehold grasp`, one or more), most (grasps that are returned), approach_axis (in the
gripper's frame), approach_distance, retreat_distance [m], max_contact_force [N]. The goal's object is found by name;
its pose is the first of `mesh_poses` or `primitive_poses`, or the frame of its header itself.
"""

from typing import Any

import rclpy
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from grasping_msgs.action import GraspPlanning
from moveit_msgs.msg import Grasp, GripperTranslation
from rclpy.action import ActionServer
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from surehold_ros.stored_grasps import GraspsOf, Planned, placed, read


class GraspPlanner(Node):
    """Answers with the stored grasps of an object."""

    def __init__(self) -> None:
        super().__init__("grasp_planner")
        files = self.declare_parameter("files", [""]).value
        self._most = int(self.declare_parameter("most", 20).value)
        self._axis = [float(v) for v in self.declare_parameter("approach_axis", [0.0, 0.0, 1.0]).value]
        self._approach = float(self.declare_parameter("approach_distance", 0.10).value)
        self._retreat = float(self.declare_parameter("retreat_distance", 0.10).value)
        self._force = float(self.declare_parameter("max_contact_force", 0.0).value)
        stored = [read(file) for file in files if file]
        self._stored = {one.object: one for one in stored}
        if not self._stored:
            raise ValueError("the parameter files names no file of grasps")
        self._action = ActionServer(self, GraspPlanning, "plan_grasps", self.plan)

    def plan(self, goal: Any) -> Any:
        """Answer a goal; it is aborted if there is no grasp of the object."""
        result = GraspPlanning.Result()
        wanted = goal.request.object
        stored = self._stored.get(wanted.name)
        if stored is None or not stored.grasps:
            known = ", ".join(self._stored)
            self.get_logger().error(f"no grasp of '{wanted.name}' is stored; there are those of: {known}")
            goal.abort()
            return result
        result.grasps = [self._grasp(wanted, stored, one) for one in stored.grasps[: self._most]]
        goal.publish_feedback(GraspPlanning.Feedback(grasps=result.grasps))
        goal.succeed()
        return result

    def _grasp(self, wanted: Any, stored: GraspsOf, one: Planned) -> Any:
        position, orientation = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        for pose in [*wanted.mesh_poses, *wanted.primitive_poses][:1]:
            p, q = pose.position, pose.orientation
            position, orientation = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
        position, orientation = placed(position, orientation, one)
        at = PoseStamped()
        at.header.frame_id = wanted.header.frame_id or stored.object
        at.pose.position.x, at.pose.position.y, at.pose.position.z = position
        o = at.pose.orientation
        o.x, o.y, o.z, o.w = orientation
        grasp = Grasp(id=one.name, grasp_pose=at, grasp_quality=one.quality, max_contact_force=self._force)
        grasp.pre_grasp_posture, grasp.grasp_posture = _posture(one.open), _posture(one.closed)
        grasp.pre_grasp_approach = _translation(stored.gripper_frame, self._axis, self._approach)
        grasp.post_grasp_retreat = _translation(at.header.frame_id, [0.0, 0.0, 1.0], self._retreat)
        grasp.post_place_retreat = _translation(stored.gripper_frame, [-v for v in self._axis], self._approach)
        grasp.allowed_touch_objects = [wanted.name]
        return grasp


def _posture(joints: dict[str, float]) -> Any:
    """Return a trajectory of one point: joints by name."""
    point = JointTrajectoryPoint(positions=list(joints.values()), time_from_start=Duration(sec=1))
    return JointTrajectory(joint_names=list(joints), points=[point])


def _translation(frame: str, direction: list[float], distance: float) -> Any:
    along = Vector3Stamped()
    along.header.frame_id = frame
    along.vector.x, along.vector.y, along.vector.z = direction
    return GripperTranslation(direction=along, desired_distance=distance, min_distance=0.5 * distance)


def main() -> None:
    """Run the node."""
    rclpy.init()
    try:
        rclpy.spin(GraspPlanner())
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()
