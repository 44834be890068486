"""The next trial where trials succeed or fail: the expected improvement of the probability of success.

Under input noise that of the probability averaged over it, by joint draws. Places whose probability is settled are not
tried again while others are left (the estimation bounds of Tesch et al. 2013).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import SETTLED
from surehold.optimization.acquisition.beta_improvement import BetaImprovement
from surehold.optimization.acquisition.probability_improvement import ProbabilityImprovement
from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement
from surehold.optimization.acquisition.where_to_look import where_to_look
from surehold.optimization.maximizer.ascent import Objective
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.protocol import Posterior, mixture
from surehold.optimization.surrogates.success.posterior import SuccessPosterior

__all__ = ["SuccessImprovement"]


@dataclass(frozen=True)
class SuccessImprovement:
    """Expected improvement of the probability of success, which the posterior is of."""

    ranking: Ranking
    counted: bool = False
    """whether the posterior is that of the beta process"""

    repeats: ClassVar[int] = 0
    continues_chains: ClassVar[bool] = False

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first."""
        scale = "exact" if self.ranking.exact_inputs else "robust"
        best, anchors = self.ranking.incumbent(posterior, history, scale)
        best = float(np.mean(best))
        if len(history.pending):
            posterior = posterior.with_pending(history.pending)
        objective: Objective
        if self.counted:
            objective = BetaImprovement(posterior, self.ranking.coarse, best)
        elif self.ranking.exact_inputs and isinstance(posterior, SuccessPosterior):
            objective = ProbabilityImprovement(posterior, best)
        else:
            objective = RiskImprovement(posterior, self.ranking.coarse, Risk(), best, rng)
        found = multistart(objective, objective, anchors.shape[1], anchors, rng, posterior.regions, history.admission)
        if not len(found):
            return found
        if not self.ranking.exact_inputs:
            looks = where_to_look(posterior, found[0], self.ranking.accurate, self.ranking.coarse)
            found = np.concatenate([looks, found])
        deviation = np.sqrt(mixture(posterior.moments(found))[1])
        open_ = deviation >= SETTLED
        return found[open_] if open_.any() else found[np.argsort(-deviation, kind="stable")]
