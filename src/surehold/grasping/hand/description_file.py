"""The description of a hand as YAML text with comments: what was found and what a person may want to change."""

import json
import re
from typing import Any

import yaml

from surehold.grasping.hand.proposal import Proposal

__all__ = ["description_text"]

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")


def description_text(proposal: Proposal, model: str) -> str:
    """Return the YAML of a proposal; `model` is the path of its model as seen from the folder of the description."""
    config = proposal.config
    palm, (name, preshape) = config.palm, next(iter(config.preshapes.items()))
    kind = "a gripper: its fingers stand apart and close towards each other" if proposal.gripper else "a hand"
    lines = [
        f"# Proposed by `surehold hand new {_text(model)}`, from the places of bodies and joints.",
        "# Look at it with `surehold hand show`; lengths are in meters, angles in radians.",
        f"name: {_text(config.name)}",
        f"model: {{file: {_text(model)}}}  # seen from this file's folder",
        f"palm:  # {kind}",
        f"  body: {_text(palm.body)}  # everything is measured from it",
        f"  x: {_vector(palm.x)}  # {_meaning_of_x(proposal)}, in that body's frame",
        f"  z: {_vector(palm.z)}  # out of the palm, towards what is grasped",
        f"  grasp_center: {_vector(palm.grasp_center)}  # in the palm frame [m]: where an object shall be",
        "fingers:  # joints from the palm to the tip",
    ]
    for finger, joints in config.fingers.items():
        opposed = "  # the others close against it" if finger == proposal.opposed else ""
        lines.append(f"  {_text(finger)}: [{', '.join(map(_text, joints))}]{opposed}")
    if proposal.resting:
        lines.append(f"# joints that no finger has, and that stay at rest: {', '.join(map(_text, proposal.resting))}")
    followers = [
        f"{_text(joint)} follows {_text(role[8:])}" for joint, role in proposal.roles.items() if role[:8] == "follows "
    ]
    if followers:
        lines.append(f"# by the model: {', '.join(followers)}")
    rest = "joints that are not named are at 0, or at the nearest end of their range"
    lines += [
        "# finger_force: 8  # what a stretched finger can exert at its tip [N]: of the maker's data sheet",
        "# friction: 0.6    # coefficient of its skin on objects; the object's own otherwise",
        "preshapes:",
        f"  {name}:",
        f"    open:  # {rest}" if preshape.open else f"    open: {{}}  # {rest}",
        *(_joint_line(joint, value, proposal) for joint, value in preshape.open.items()),
        "    closed:  # as far as a joint goes where nothing stops it",
        *(_joint_line(joint, value, proposal) for joint, value in preshape.closed.items()),
    ]
    opposing = [joint for joint, role in proposal.roles.items() if role == "opposes"]
    if opposing:
        lines += [
            "    # To search the opposition, too (variable s1), give its range and what it moves, per unit of s1:",
            f"    # posture: {{range: [-0.5, 0.5], joints: {{{_text(opposing[0])}: 1}}}}",
        ]
    return "\n".join(lines) + "\n"


def _meaning_of_x(proposal: Proposal) -> str:
    if proposal.gripper:
        return f"across, away from {_text(proposal.opposed)}"
    return "along the fingers"


def _joint_line(joint: str, value: float, proposal: Proposal) -> str:
    lower, upper = proposal.ranges[joint]
    return f"      {_text(joint)}: {value:.6g}  # {proposal.roles[joint]}, {lower:.4g} to {upper:.4g}"


def _vector(values: Any) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"


def _text(name: str) -> str:
    """Return a name as YAML writes it in one line: quoted where it would be read as something else."""
    return name if _PLAIN.fullmatch(name) and yaml.safe_load(name) == name else json.dumps(name)
