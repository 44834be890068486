"""The next trial improves a risk measure of the outcome under input noise, or the worst case."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import SCREENING_DIVISOR
from surehold.optimization.acquisition.risk_measures import RiskImprovement, WorstCaseBound
from surehold.optimization.acquisition.where_to_look import where_to_look
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.trust_region import TrustRegion
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["RiskAverse"]


@dataclass(frozen=True)
class RiskAverse:
    """Expected improvement of the ranking's risk measure; of the worst case its upper confidence bound (StableOpt)."""

    ranking: Ranking
    kappa: float
    """standard deviations of the bounds of the worst case"""
    trust_region: TrustRegion | None = None

    repeats: ClassVar[int] = 0
    continues_chains: ClassVar[bool] = False

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first."""
        accurate, risk = self.ranking.accurate, self.ranking.risk
        best, anchors = self.ranking.incumbent(posterior, history, "robust")
        if len(history.pending):
            posterior = posterior.with_pending(history.pending)
            best = max(best, float(self.ranking.believed(posterior, history.pending, "robust")))
        regions = posterior.regions
        if self.trust_region is not None:
            regions = self.trust_region.within(regions, anchors[0], history.observed)
        d = anchors.shape[1]
        if risk.name == "worst":
            bound = WorstCaseBound(posterior, accurate, self.kappa)
            found = multistart(bound, bound, d, anchors, rng, regions, history.admission)
            if not len(found):
                return found
            return np.concatenate([bound.to_try(found[0]), found])
        improvement = RiskImprovement(posterior.thinned(SCREENING_DIVISOR), accurate, risk, best, rng)
        finer = self.ranking.correction(posterior)
        finest = None if finer is None else improvement.corrected(finer)
        found = multistart(improvement, improvement, d, anchors, rng, regions, history.admission, finest)
        if not len(found):
            return found
        return np.concatenate([where_to_look(posterior, found[0], accurate, self.ranking.coarse), found])
