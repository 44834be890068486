"""How much a further trial is expected to bring: what a study stops by."""

from dataclasses import replace

import numpy as np

from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement
from surehold.optimization.acquisition.scales import Acquisition, CriterionName, Scale
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["promise"]


def promise(ranking: Ranking, posterior: Posterior, history: History, rng: np.random.Generator) -> float:
    """Return the largest expected improvement of the outcome under the input noise, over all inputs.

    Over the best input tried so far. Of a risk measure its improvement; of the worst case that of the mean, for the
    worst case has no distribution.
    """
    finest = None
    if not len(history.tried):  # nothing feasible is known: whatever is, is an improvement
        return float("inf")
    scale: Scale = "exact" if ranking.exact_inputs else "robust"
    if ranking.risk.name in ("mean", "worst"):
        best, anchors = replace(ranking, risk=Risk()).incumbent(posterior, history, scale)
        objective, screen = (
            Acquisition(posterior, CriterionName("ei", scale), perturbations, best)
            for perturbations in (ranking.accurate, ranking.accurate if ranking.exact_inputs else ranking.coarse)
        )
    else:
        best, anchors = ranking.incumbent(posterior, history, scale)
        objective = screen = RiskImprovement(posterior, ranking.accurate, ranking.risk, float(best), rng)
        finer = ranking.correction(posterior)
        finest = None if finer is None else objective.corrected(finer)
    found = multistart(objective, screen, anchors.shape[1], anchors, rng, posterior.regions, history.admission, finest)
    objective = objective if finest is None else finest
    if history.admission is not None:
        if not len(found):
            return 0.0
        objective = history.admission.weighed(objective)
    return max(float(objective(found[:1])[0]), 0.0)
