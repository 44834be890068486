"""Python classes of ROS 2 interfaces, made from their definitions, that take what real ones take and nothing else.

The definitions are the fields of the published interfaces; what the example does not touch of a message is left out
where it says so.
"""

import re
import sys
from types import ModuleType

PUBLISHED = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/msg/Float64": "float64 data",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message",
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w 1",
    "geometry_msgs/msg/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\nPose pose",
    "geometry_msgs/msg/Vector3Stamped": "std_msgs/Header header\nVector3 vector",
    "trajectory_msgs/msg/JointTrajectoryPoint": "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\n"
    "float64[] effort\nbuiltin_interfaces/Duration time_from_start",
    "trajectory_msgs/msg/JointTrajectory": "std_msgs/Header header\nstring[] joint_names\n"
    "JointTrajectoryPoint[] points",
    "moveit_msgs/msg/GripperTranslation": "geometry_msgs/Vector3Stamped direction\nfloat32 desired_distance\n"
    "float32 min_distance",
    "moveit_msgs/msg/Grasp": "string id\ntrajectory_msgs/JointTrajectory pre_grasp_posture\n"
    "trajectory_msgs/JointTrajectory grasp_posture\ngeometry_msgs/PoseStamped grasp_pose\nfloat64 grasp_quality\n"
    "GripperTranslation pre_grasp_approach\nGripperTranslation post_grasp_retreat\n"
    "GripperTranslation post_place_retreat\nfloat32 max_contact_force\nstring[] allowed_touch_objects",
    "grasping_msgs/msg/ObjectProperty": "string name\nstring value",
    # without point_cluster, primitives, meshes and surface
    "grasping_msgs/msg/Object": "std_msgs/Header header\nstring name\nstring support_surface\n"
    "ObjectProperty[] properties\n"
    "geometry_msgs/Pose[] primitive_poses\ngeometry_msgs/Pose[] mesh_poses",
    "grasping_msgs/action/GraspPlanning": "Object object\nstring group_name\n---\nmoveit_msgs/Grasp[] grasps\n---\n"
    "moveit_msgs/Grasp[] grasps",
    # without arrays
    "rcl_interfaces/msg/ParameterValue": "uint8 type\nbool bool_value\nint64 integer_value\nfloat64 double_value\n"
    "string string_value",
    "rcl_interfaces/msg/Parameter": "string name\nParameterValue value",
    "rcl_interfaces/msg/SetParametersResult": "bool successful\nstring reason",
    "rcl_interfaces/srv/GetParameters": "string[] names\n---\nParameterValue[] values",
    "rcl_interfaces/srv/SetParametersAtomically": "Parameter[] parameters\n---\nSetParametersResult result",
}
_PARTS = {"msg": ("",), "srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}


def install(monkeypatch, more):
    """Put the modules of all interfaces, those of `more` besides, into sys.modules for a test."""
    classes = {}
    for name, text in {**PUBLISHED, **more}.items():
        package, kind, short = name.split("/")
        parts = re.split(r"^---$", text, flags=re.MULTILINE)
        assert len(parts) == len(_PARTS[kind]), f"{name} has {len(parts)} parts"
        made = [_message(package, short + part, one, classes) for part, one in zip(_PARTS[kind], parts, strict=True)]
        whole = made[0] if kind == "msg" else type(short, (), dict(zip(_PARTS[kind], made, strict=True)))
        classes[f"{package}/{short}"] = whole
        for module in (package, f"{package}.{kind}"):
            if getattr(sys.modules.get(module), "made_here", False) is False:
                monkeypatch.setitem(sys.modules, module, ModuleType(module))
                sys.modules[module].made_here = True
        setattr(sys.modules[f"{package}.{kind}"], short, whole)


def _message(package, name, text, classes):
    fields = {}
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words and "=" not in line:
            kind, _, array = words[0].partition("[")
            plain = re.fullmatch(r"(bool|string|float|int|uint)(\d*)", kind)
            full = kind if plain or "/" in kind else f"{package}/{kind}"
            fields[words[1]] = (plain[1].removeprefix("u") if plain else full, bool(array), words[2:])

    def fresh(kind):
        return {"bool": bool, "string": str, "float": float, "int": int}.get(kind) or classes[kind]

    def taken(field, value):
        kind, many, _ = fields[field]
        for one in value if many else [value]:
            right = (
                type(one) is fresh(kind) if kind in ("bool", "int", "float", "string") else isinstance(one, fresh(kind))
            )
            assert right, f"{package}/{name}.{field} takes {kind}, not {one!r}"
        assert not many or isinstance(value, list), f"{package}/{name}.{field} takes a list"

    class Message:
        def __init__(self, **given):
            for field, (kind, many, default) in fields.items():
                setattr(self, field, given.pop(field, [] if many else fresh(kind)(*map(float, default))))
            assert not given, f"{package}/{name} has no {given}"

        def __setattr__(self, field, value):
            assert field in fields, f"{package}/{name} has no field {field}"
            taken(field, value)
            object.__setattr__(self, field, value)

    Message.__name__ = name
    return Message
