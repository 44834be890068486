"""The requirements that follow from an optimizer's settings."""

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.constraints.input import Region
from surehold.optimization.lattice import Lattice
from surehold.optimization.limits import Limit
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.requirements import Requirements
from surehold.optimization.strategy.ranking import Ranking

__all__ = ["required"]


def required(
    box: Box,
    region: Region | None,
    limits: tuple[Limit, ...],
    *,
    level: float,
    safety: float | None,
    ranking: Ranking,
    straying: InputNoise | None,
    lattice: Lattice | None,
    seed: int,
    first: NDArray[np.float64],
    preset: str | None,
    failures: str,
) -> Requirements | None:
    """Return what these settings of an `Optimizer` require, None for nothing; `first` (k, d) are tried first.

    Raises InputError for values out of range and settings that contradict each other.
    """
    for name, value in (("feasible", level), ("safety", safety)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < 1):
            raise InputError(f"{name} is {value!r}; give a probability strictly between 0 and 1, such as 0.95.")
    if safety is not None and (all(limit.watched for limit in limits) or not len(first)):
        raise InputError(
            "safety= needs constraints= with a limit, and initial_points= that are known to keep all limits."
        )
    if failures not in ("lowest", "modelled"):
        raise unknown_name("rule for failures", failures, ("lowest", "modelled"))
    if region is None and not limits and failures == "lowest":
        return None
    if preset is not None:
        raise InputError(
            f"preset='{preset}' chooses trials as the thesis does, which knows no constraints; leave one out."
        )
    return Requirements(
        box,
        region,
        limits,
        level=level,
        safety=safety,
        ranking=ranking,
        straying=straying,
        noise="inferred" if ranking.noisy and straying is None else "none",
        lattice=lattice,
        seed=seed,
        failures=failures == "modelled",
    )
