"""The next trial maximizes an acquisition function: the expected improvement, or another criterion in its place.

With input noise the unscented form averages the criterion over sigma points, the robust form takes the criterion of the
averaged outcome; see `acquisition.scales`.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import MARGIN, MARGIN_UNDER_NOISE, POLISH_PERIOD, SCREENING_DIVISOR
from surehold.optimization.acquisition.scales import Acquisition, CriterionName
from surehold.optimization.acquisition.where_to_look import where_to_look
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.trust_region import TrustRegion
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["ExpectedImprovement"]


@dataclass(frozen=True)
class ExpectedImprovement:
    """The strategy of the criteria "ei", "log_ei", "pi" and "ucb", and of their forms under input noise."""

    ranking: Ranking
    criterion: CriterionName
    kappa: float
    """standard deviations of the upper confidence bound"""
    trust_region: TrustRegion | None = None

    repeats: ClassVar[int] = 0
    continues_chains: ClassVar[bool] = False

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first."""
        scale, ranking = self.criterion.scale, self.ranking
        best, anchors = ranking.incumbent(posterior, history, scale)
        if len(history.pending):
            posterior = posterior.with_pending(history.pending)
            best = np.maximum(best, ranking.believed(posterior, history.pending, scale))
        regions = posterior.regions
        if self.trust_region is not None:
            regions = self.trust_region.within(regions, anchors[0], history.observed)
        d = anchors.shape[1]
        margin = self._margin(history)
        accurate, few = (Perturbations(exact(d)),) * 2 if scale == "exact" else (ranking.accurate, ranking.screen)
        found = multistart(
            Acquisition(posterior, self.criterion, accurate, best, margin=margin, kappa=self.kappa),
            Acquisition(
                posterior.thinned(SCREENING_DIVISOR),
                self.criterion,
                few,
                float(np.mean(best)),
                margin=margin,
                kappa=self.kappa,
            ),
            d,
            anchors,
            rng,
            regions,
            history.admission,
            history.spread if self.criterion.base in ("ei", "ucb") else None,
        )
        if not len(found):
            return found
        if scale == "robust":
            found = np.concatenate([where_to_look(posterior, found[0], accurate, ranking.coarse), found])
        return found

    def _margin(self, history: History) -> float:
        """Return the improvement that does not count, in the outputs' units."""
        polish = history.told % POLISH_PERIOD == 0 and not len(history.pending)
        if self.ranking.noisy or polish:
            return 0.0
        return (MARGIN if self.criterion.scale == "exact" else MARGIN_UNDER_NOISE) * history.spread
