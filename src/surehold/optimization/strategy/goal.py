"""What counts as good, and the next trial that follows from it: criterion, input noise and risk together.

Legend
    U         points of the unit cube, (q, d)
    accurate  perturbations by which outcomes under the input noise are computed
    coarse    sigma points: cheap, good enough to choose where to look closer
    outcome   UO(x) = sum_i w_i mean_j mu_j(x + xi_i) over perturbations i and particles j     thesis (3.21)
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement, WorstCaseBound
from surehold.optimization.acquisition.scales import Acquisition, CriterionName, where_to_look
from surehold.optimization.maximizer import multistart as maximizer
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.strategy.trust_region import box_around, side_after
from surehold.optimization.surrogates.protocol import Posterior, mixture

__all__ = ["Goal"]

_ANCHORS: Final = 3
_SHORTLIST: Final = 16
_SCREENED: Final = 3  # particles, of all, that choose where to look closer
_PLAUSIBLE: Final = 3.0  # standard deviations within which a function is drawn
_JOINT: Final = 512  # points at which it is drawn: the cost grows with the cube
_PATIENCE: Final = 3
# Improvement that is worth a trial where observations are exact, in mean absolute deviations of the outputs. Without it
# what is left of the model's variance beside the incumbent, the nugget's, draws trial after trial to the same hill. Of
# an outcome averaged over input noise more is left: with 0.001 the broad hill of GM holds 4 of 30 runs under a noise of
# 0.02, with 0.01 none.
_WORTHWHILE: Final = 1e-3
_WORTHWHILE_UNDER_NOISE: Final = 1e-2
_POLISH: Final = 3  # every third trial may go for any improvement: a smooth top is still found to many digits


@dataclass(frozen=True)
class Goal:
    """What an optimizer is after."""

    criterion: CriterionName
    accurate: Perturbations
    coarse: Perturbations
    risk: Risk
    margin: float
    """improvement that does not count"""
    kappa: float
    """standard deviations of the confidence bounds"""
    noisy: bool
    """whether observations carry noise, so that the highest one is no incumbent"""
    trust_region: bool
    """whether the next trial is sought in a box around the best one, which grows and shrinks with success"""
    n_initial: int
    """trials of the initial design"""
    thesis: bool
    """whether candidates are sought and improvement is measured as in the thesis"""

    def rank(
        self, posterior: Posterior, U: NDArray[np.float64], observed: NDArray[np.float64] | None = None
    ) -> NDArray[np.intp]:
        """Return the indices of U, the input with the best outcome under the input noise first.

        Observed values (q,) decide where both inputs and observations are exact. Where the accurate perturbations are
        many, all inputs are ranked by the coarse ones and the first of them again.
        """
        if observed is not None and not self.noisy and len(self.accurate.quadrature.weights) == 1:
            return np.argsort(-observed, kind="stable")
        if self.thesis:
            first = _outcomes(posterior, self.accurate, U)
        else:
            first = _outcomes(posterior.thinned(_SCREENED), self.coarse, U)
        order = np.argsort(-first, kind="stable")
        top = order[:_SHORTLIST]
        if self.risk.name == "mean":
            values = _outcomes(posterior, self.accurate, U[top])
        else:
            values = self._risk(posterior, 0.0).expectation(U[top])
        order[:_SHORTLIST] = top[np.argsort(-values, kind="stable")]
        return order

    def best(self, posterior: Posterior, tried: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the point of the cube (d,) with the best modelled outcome under the input noise."""
        anchors = tried[self.rank(posterior, tried)[:_ANCHORS]]
        if self.risk.name == "mean":
            mean = CriterionName("ucb", "robust")
            accurate, coarse = (
                Acquisition(posterior, mean, perturbations, 0.0, kappa=0.0)
                for perturbations in (self.accurate, self.coarse)
            )
            found = maximizer.multistart(accurate, coarse, anchors.shape[1], anchors, rng, posterior.regions)
        else:
            risk = self._risk(posterior, -np.inf)
            found = maximizer.multistart(risk, risk, anchors.shape[1], anchors, rng, posterior.regions)
        candidates = np.concatenate([anchors[:1], found[:_ANCHORS]])
        return candidates[self.rank(posterior, candidates)[0]]

    def candidates(
        self,
        posterior: Posterior,
        tried: NDArray[np.float64],
        observed: NDArray[np.float64],
        pending: NDArray[np.float64],
        failed: NDArray[np.float64],
        rng: np.random.Generator,
    ) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first.

        Parameters
        ----------
        posterior
            The surrogate conditioned on the trials that are told.
        tried, observed
            Inputs (n, d) that gave a value, and the values (n,).
        pending : (p, d)
            Trials under way: the model takes its own mean for granted there.
        failed : (f, d)
            Inputs that gave no value.
        """
        if not (self.thesis or self.trust_region) and self._stalled(
            posterior, tried, observed, len(tried) + len(failed)
        ):
            return maximizer.largest_holes(np.concatenate([tried, failed, pending]), rng)
        best, anchors = self._incumbent(posterior, tried, observed)
        if self.criterion.base == "thompson" and self.risk.name == "mean":
            return self._drawn(posterior, anchors, rng)
        if len(pending):
            posterior = posterior.with_pending(pending)
            best = np.maximum(best, self._believed(posterior, pending))
        d = tried.shape[1]
        regions = posterior.regions
        if self.trust_region:
            regions = regions.within(box_around(anchors[0], side_after(observed, self.n_initial, d)))
        if self.risk.name == "worst":
            bound = WorstCaseBound(posterior, self.accurate, self.kappa)
            found = maximizer.multistart(bound, bound, d, anchors, rng, regions)
            return np.concatenate([bound.weakest(found[0]), found])
        if self.risk.name != "mean":
            improvement = RiskImprovement(posterior, self.accurate, self.risk, float(best), rng)
            found = maximizer.multistart(improvement, improvement, d, anchors, rng, regions)
            return np.concatenate([self._looks(posterior, found[0]), found])
        exactly = self.criterion.scale == "exact"
        margin = self.margin
        polish = (len(tried) + len(failed)) % _POLISH == 0 and not len(pending)
        if not (self.thesis or self.noisy or polish):
            margin = (_WORTHWHILE if exactly else _WORTHWHILE_UNDER_NOISE) * _spread(observed)
        reached = (Perturbations(exact(d)),) * 2 if exactly else (self.accurate, self.coarse)
        accurate = self._acquisition(posterior, reached[0], best, margin)
        if self.thesis:
            return maximizer.direct(accurate, d, anchors[0], rng, regions)
        coarse = self._acquisition(posterior.thinned(_SCREENED), reached[1], float(np.mean(best)), margin)
        found = maximizer.multistart(accurate, coarse, d, anchors, rng, regions)
        if self.criterion.scale == "robust":
            found = np.concatenate([self._looks(posterior, found[0]), found])
        return found

    def promise(
        self,
        posterior: Posterior,
        tried: NDArray[np.float64],
        observed: NDArray[np.float64],
        rng: np.random.Generator,
    ) -> float:
        """Return the largest improvement, expected of any input, of the outcome under the input noise.

        Over the best of the inputs tried (n, d), whose values are `observed` (n,). Of a risk measure its improvement;
        of the worst case that of the mean, for the worst case has no distribution.
        """
        d = tried.shape[1]
        if self.risk.name in ("mean", "worst"):
            exact_inputs = len(self.accurate.quadrature.weights) == 1
            goal = replace(
                self, criterion=CriterionName("ei", "exact" if exact_inputs else "robust"), risk=Risk("mean")
            )
            best, anchors = goal._incumbent(posterior, tried, observed)
            objective, screen = (
                goal._acquisition(posterior, perturbations, best, 0.0)
                for perturbations in (self.accurate, self.accurate if exact_inputs else self.coarse)
            )
        else:
            best, anchors = self._incumbent(posterior, tried, observed)
            objective = screen = RiskImprovement(posterior, self.accurate, self.risk, float(best), rng)
        found = maximizer.multistart(objective, screen, d, anchors, rng, posterior.regions)
        return max(float(objective(found[:1])[0]), 0.0)

    def _stalled(
        self, posterior: Posterior, tried: NDArray[np.float64], observed: NDArray[np.float64], trials: int
    ) -> bool:
        """Tell whether this trial should insure against a wrong model; `trials` were told, failed ones included.

        A model that is too smooth can be sure that nothing is left to find. Where none of the last trials is the best
        one, every third trial goes where nothing has been tried.
        """
        n = len(tried)
        if n <= _PATIENCE or trials % _PATIENCE != 0:
            return False
        if self.criterion.scale == "exact":
            values = mixture(posterior.moments(tried))[0] if self.noisy else observed
            return int(np.argmax(values)) < n - _PATIENCE
        return int(self.rank(posterior, tried)[0]) < n - _PATIENCE

    def _incumbent(
        self, posterior: Posterior, tried: NDArray[np.float64], observed: NDArray[np.float64]
    ) -> tuple[Any, NDArray[np.float64]]:
        """Return the value to improve upon, on the criterion's scale, and the best tried inputs (a, d)."""
        if self.criterion.scale == "exact":
            values = mixture(posterior.moments(tried))[0] if self.noisy else observed
            return float(values.max()), tried[np.argsort(-values, kind="stable")[:_ANCHORS]]
        anchors = tried[self.rank(posterior, tried)[:_ANCHORS]]
        if self.thesis:  # the original improves upon the best observed value inside UEI too
            return float(observed.max()), anchors
        if self.risk.name != "mean":
            return float(self._risk(posterior, 0.0).expectation(anchors[:1])[0]), anchors
        best = self.accurate.outcome(posterior, anchors[:1]).mean  # (m, 1)
        return best if self.criterion.scale == "robust" else float(best.mean()), anchors

    def _drawn(
        self, posterior: Posterior, anchors: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return candidates (c, d), the maximum of a function drawn from the posterior first (Thompson sampling).

        One particle is drawn, then its function (of the outcome under the input noise where the scale is robust) at
        the candidates with the highest upper confidence bounds, jointly. Trials under way need no care: every draw
        is another function.
        """
        d = anchors.shape[1]
        one = posterior.thinned(1, int(rng.integers(2**31)))
        perturbations = self.coarse if self.criterion.scale == "robust" else Perturbations(exact(d))
        points = maximizer.promising(d, anchors, rng, posterior.regions)
        bound = CriterionName("ucb", "robust")
        upper = Acquisition(one, bound, perturbations, 0.0, kappa=_PLAUSIBLE)(points)
        weights = perturbations.quadrature.weights
        points = points[np.argsort(-upper, kind="stable")[: _JOINT // len(weights)]]
        around = perturbations.around(points).reshape(1, -1, d)
        draw = one.sample(around, rng.standard_normal((1, around.shape[1])))[0, 0, 0]
        return points[np.argsort(-(draw.reshape(len(points), -1) @ weights), kind="stable")]

    def _believed(self, posterior: Posterior, pending: NDArray[np.float64]) -> Any:
        """Return the best value that trials under way (p, d) are believed to give, on the criterion's scale.

        Without it a second trial would be sent to the top on which the first one is on its way.
        """
        if self.risk.name != "mean":
            return self._risk(posterior, 0.0).expectation(pending).max()
        perturbations = Perturbations(exact(pending.shape[1])) if self.criterion.scale == "exact" else self.accurate
        mean = perturbations.outcome(posterior, pending).mean  # (m, p)
        return mean.mean(axis=0).max() if self.criterion.scale == "unscented" else mean.max(axis=1, keepdims=True)

    def _acquisition(self, posterior: Posterior, perturbations: Perturbations, best: Any, margin: float) -> Acquisition:
        return Acquisition(posterior, self.criterion, perturbations, best, margin=margin, kappa=self.kappa)

    def _looks(self, posterior: Posterior, u: NDArray[np.float64]) -> NDArray[np.float64]:
        return where_to_look(posterior, u, self.accurate, self.coarse.around(u[None, :])[0] - u)

    def _risk(self, posterior: Posterior, best: float) -> RiskImprovement:
        # The same draws at every call: ranking must not depend on how often it was asked for.
        return RiskImprovement(posterior, self.accurate, self.risk, best, np.random.default_rng(0))


def _spread(values: NDArray[np.float64]) -> float:
    return float(np.abs(values - values.mean()).mean())


def _outcomes(posterior: Posterior, perturbations: Perturbations, U: NDArray[np.float64]) -> NDArray[np.float64]:
    return perturbations.outcome(posterior, U).mean.mean(axis=0)
