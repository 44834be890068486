"""The next trial improves a risk measure of the outcome under input noise, or the worst case."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import ANCHORS, LAST_EVALUATIONS, SCREENING_DIVISOR, STARTS
from surehold.optimization.acquisition.risk_measures import RiskImprovement, WorstCaseBound
from surehold.optimization.acquisition.where_to_look import where_to_look
from surehold.optimization.maximizer.ascent import climb
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.trust_region import TrustRegion
from surehold.optimization.surrogates.protocol import Posterior, Regions

__all__ = ["RiskAverse", "most_improving"]


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
        best, finer = self.ranking.shortlist(posterior, history), self.ranking.correction(posterior)
        if len(history.pending):
            posterior = posterior.with_pending(history.pending)
        regions = posterior.regions
        if self.trust_region is not None:
            regions = self.trust_region.within(regions, best[0], history.observed)
        if risk.name == "worst":
            bound = WorstCaseBound(posterior, accurate, self.kappa)
            d, admission = best.shape[1], history.admission
            found = multistart(bound, bound, d, best[:ANCHORS], rng, regions, admission, history.spread)
            if not len(found):
                return found
            return np.concatenate([bound.to_try(found[0]), found])
        some = posterior.thinned(SCREENING_DIVISOR)
        found, _ = most_improving(self.ranking, some, best, finer, history, rng, regions)
        if not len(found):
            return found
        return np.concatenate([where_to_look(posterior, found[0], accurate, self.ranking.coarse), found])


def most_improving(
    ranking: Ranking,
    posterior: Posterior,
    best: NDArray[np.float64],
    finer: Perturbations | None,
    history: History,
    rng: np.random.Generator,
    regions: Regions,
) -> tuple[NDArray[np.float64], float]:
    """Return points of the cube (c, d), the one first that improves a risk measure most, and what it is expected to.

    The search is by the few perturbations of the ranking. The best place by more of them lies a little beside: there
    a climb by more of them ends, from the first of `best`. That place and the tops of the search are compared by
    more of them. Nothing can be tried: no points, and no improvement.

    Parameters
    ----------
    posterior
        With pending trials taken in.
    best : (a, d)
        The best tried inputs, best first.
    finer
        Perturbations that correct the measure; None: nothing does.
    """
    measure = RiskImprovement(posterior, ranking.accurate, ranking.risk, None, rng)
    known = np.concatenate([best, history.pending])
    improvement, admission = measure.over(known), history.admission
    unit = history.spread
    found = multistart(improvement, improvement, best.shape[1], best[:ANCHORS], rng, regions, admission, unit)
    if not len(found):
        return found, 0.0
    corrected = measure.corrected(finer).over(known)
    objective = corrected if admission is None else admission.weighed(corrected)
    tops, start = found[:STARTS], (best if admission is None else best[admission.possible(best)])[:1]
    if finer is not None and len(start):
        lower, upper = regions.lower.min(axis=0)[None, :], regions.upper.max(axis=0)[None, :]
        beside, _ = climb(objective, start, lower, upper, LAST_EVALUATIONS, unit)
        tops = np.concatenate([beside, tops])
    gains = objective(tops)
    order = np.argsort(-gains, kind="stable")
    return np.concatenate([tops[order], found[STARTS:]]), float(gains[order[0]])
