"""How much a further trial is expected to bring: what a study stops by."""

from dataclasses import replace

import numpy as np

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import Acquisition, CriterionName, Scale
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.risk import most_improving
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["promise"]


def promise(ranking: Ranking, posterior: Posterior, history: History, rng: np.random.Generator) -> float:
    """Return the largest expected improvement of the outcome under the input noise, over all inputs.

    Over the best input tried so far. Of a risk measure its improvement; of the worst case that of the mean, for the
    worst case has no distribution.
    """
    if not len(history.tried):  # nothing feasible is known: whatever is, is an improvement
        return float("inf")
    if ranking.risk.name not in ("mean", "worst"):
        history = history._replace(pending=history.pending[:0])
        best, finer = ranking.shortlist(posterior, history), ranking.correction(posterior)
        return max(most_improving(ranking, posterior, best, finer, history, rng, posterior.regions)[1], 0.0)
    scale: Scale = "exact" if ranking.exact_inputs else "robust"
    best, anchors = replace(ranking, risk=Risk()).incumbent(posterior, history, scale)
    objective, screen = (
        Acquisition(posterior, CriterionName("ei", scale), perturbations, best)
        for perturbations in (ranking.accurate, ranking.accurate if ranking.exact_inputs else ranking.screen)
    )
    found = multistart(
        objective, screen, anchors.shape[1], anchors, rng, posterior.regions, history.admission, history.spread
    )
    if history.admission is not None:
        if not len(found):
            return 0.0
        objective = history.admission.weighed(objective)
    return max(float(objective(found[:1])[0]), 0.0)
