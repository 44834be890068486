"""From which quality on grasps were held: thresholds measured in physics, for the grasps that they were measured with.

`python -m benchmarks.quality_predicts` measures them; docs/results/quality-predicts.md says how. Another hand, facet,
quality, contact model or input noise, or a hand that turns, has other thresholds, of which nothing is said.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from surehold.grasping.hand.named import hand_named
from surehold.grasping.object.shipped import shipped_object
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.grasp.problem import GraspProblem

__all__ = ["MEASURED", "Thresholds", "measured_thresholds", "threshold_in_words"]


class Thresholds(NamedTuple):
    """Of how many grasps they are, and the two values of epsilon, averaged over input noise of 3 %; NaN if none is."""

    grasps: int
    none_below: float  #: no grasp below was held
    most_above: float  #: nine of ten above were held


_NOISE: Final = 0.03  # of the box
#: By object and facet: grasps of the left iCub hand with the force of its fingers, 8 N.
MEASURED: Final = {
    ("bottle", "right-front"): Thresholds(200, 0.037, 0.074),
    ("mug", "right-front"): Thresholds(200, 0.063, 0.116),
    ("glass", "right-front"): Thresholds(200, 0.053, 0.074),
    ("drill", "bottom-front"): Thresholds(200, math.nan, math.nan),
}


def measured_thresholds(problem: GraspProblem, noise: InputNoise | None) -> Thresholds | None:
    """Return the thresholds of a problem's grasps under that noise if they are of the kind measured, else None."""
    simulator, measure = problem.simulator, problem.simulator.measure
    found = MEASURED.get((problem.object.name, problem.facet))
    alike = (
        found is not None
        and problem.object is shipped_object(problem.object.name)
        and simulator.hand is hand_named("icub-left")
        and (simulator.preshape, simulator.contact, simulator.closing) == ("power", "graded", "adaptive")
        and (measure.name, measure.friction) == ("epsilon", problem.object.friction)
        and (measure.cones, measure.torsion) == ("round", 0.0)
        and {"dx", "dy", "dz"}.issuperset(problem.box.names)
        and noise is not None
        and np.allclose(noise.unit_covariance(problem.box), _NOISE**2 * np.eye(len(problem.box.names)), atol=1e-9)
    )
    return found if alike else None


def threshold_in_words(problem: GraspProblem, mean: float, noise: InputNoise | None) -> str:
    """Return what the thresholds say of a grasp of that mean quality under input noise; "" where none were measured."""
    found = measured_thresholds(problem, noise)
    if found is None or not math.isfinite(mean):
        return ""
    of = f"of {found.grasps} grasps measured"
    if math.isnan(found.none_below):
        return f"{of} none was held with {problem.simulator.hand.finger_force:g} N a finger"
    if mean >= found.most_above:
        return f"{mean:.3f} on average: {of} nine of ten above {found.most_above:g} were held"
    beyond = f", nine of ten above {found.most_above:g}" if mean >= found.none_below else ""
    return f"{mean:.3f} on average: {of} none below {found.none_below:g} was held{beyond}"
