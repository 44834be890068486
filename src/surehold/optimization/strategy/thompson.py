"""Thompson sampling: the next trial is the maximum of a function drawn from the posterior."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import JOINT_POINTS, PLAUSIBLE
from surehold.optimization.acquisition.scales import Acquisition, CriterionName
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.maximizer.multistart import promising
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["Thompson"]


@dataclass(frozen=True)
class Thompson:
    """One particle is drawn, then its function, or the outcome of that function under the input noise.

    It is drawn jointly at the candidates with the highest upper confidence bounds. Trials under way need no care: every
    draw is another function.
    """

    ranking: Ranking
    exactly: bool
    """whether the function itself is drawn, as if there were no input noise"""

    repeats: ClassVar[int] = 0
    continues_chains: ClassVar[bool] = False

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d), the maximum of the draw first."""
        _, anchors = self.ranking.incumbent(posterior, history, "exact" if self.exactly else "robust")
        d = anchors.shape[1]
        one = posterior.thinned(1, int(rng.integers(2**31)))
        perturbations = Perturbations(exact(d)) if self.exactly else self.ranking.coarse
        points = promising(d, anchors, rng, posterior.regions)
        if history.admission is not None:
            points = self._admitted(history.admission, np.concatenate([anchors, points]), rng)
            if not len(points):
                return points
        upper = Acquisition(one, CriterionName("ucb", "robust"), perturbations, 0.0, kappa=PLAUSIBLE)(points)
        weights = perturbations.quadrature.weights
        points = points[np.argsort(-upper, kind="stable")[: JOINT_POINTS // len(weights)]]
        around = perturbations.around(points).reshape(1, -1, d)
        draw = one.sample(around, rng.standard_normal((1, around.shape[1])))[0, 0, 0]
        return points[np.argsort(-(draw.reshape(len(points), -1) @ weights), kind="stable")]

    @staticmethod
    def _admitted(admission: Admission, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the points that can be tried and at which what is required holds in a draw of its own."""
        points = admission.among(points, rng)
        probability = np.exp(admission.log_probability(points)[0])
        return points[probability >= min(rng.random(), probability.max(initial=0.0))]
