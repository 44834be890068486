"""Parameters of running nodes as a trial, and what a metric says of it, without ROS in it."""

from collections.abc import Mapping, Sequence
from math import fsum, isfinite
from statistics import median

MEASURES = ("mean", "median", "min", "max", "last", "sum")


def by_node(parameters: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return the values for each node: `/controller_server.FollowPath.max_vel_x` is a parameter of /controller_server.

    The node's name ends at the first point: parameters may have points in their names, nodes may not.
    """
    nodes: dict[str, dict[str, float]] = {}
    for name, value in parameters.items():
        node, point, parameter = name.partition(".")
        if not point or not node or not parameter:
            raise ValueError(f"parameter {name!r} names no node; write NODE.PARAMETER, such as /controller.gain")
        nodes.setdefault(node if node.startswith("/") else f"/{node}", {})[parameter] = float(value)
    return nodes


def as_declared(value: float, before: object) -> float | int | bool:
    """Return the value in the type that the parameter has now: rounded for an integer, above a half for a switch."""
    if isinstance(before, bool):
        return value > 0.5
    if isinstance(before, int):
        return round(value)
    return value


def measured(values: Sequence[float], measure: str) -> float:
    """Return what the values of a metric come to; NaN without a finite one."""
    if measure not in MEASURES:
        raise ValueError(f"measure {measure!r} is unknown; take one of {', '.join(MEASURES)}")
    finite = [value for value in values if isfinite(value)]
    if not finite or len(finite) < len(values):  # a controller that blows up has failed, however it began
        return float("nan")
    if measure in ("mean", "sum"):
        total = fsum(finite)
        return total if measure == "sum" else total / len(finite)
    if measure == "median":
        return median(finite)
    return {"min": min(finite), "max": max(finite), "last": finite[-1]}[measure]
