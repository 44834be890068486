"""Which inputs are the best ones under the input noise, and the value that a further trial has to exceed.

Legend
    U         points of the unit cube, (q, d)
    accurate  quadrature by which outcomes under the input noise are computed
    coarse    sigma points
    screening a few points of the accurate rule: cheap, good enough to choose the inputs whose mean is computed again
    finer     quadrature with more points than the accurate one: too dear for a search, not for its last step
    outcome   UO(x) = sum_i w_i mean_j mu_j(x + xi_i) over perturbations i and particles j     thesis (3.21)
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import ANCHORS, CONTENDERS, SCREENING_DIVISOR, SHORTLIST
from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement
from surehold.optimization.acquisition.scales import Acquisition, CriterionName, Scale
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.maximizer.ascent import climb
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.surrogates.protocol import Posterior, means, mixture

__all__ = ["History", "Ranking"]


class History(NamedTuple):
    """The trials by which the next one is chosen; inputs in the unit cube."""

    tried: NDArray[np.float64]
    """inputs that gave a value, (n, d)"""
    observed: NDArray[np.float64]
    """their values, (n,)"""
    failed: NDArray[np.float64]
    """inputs that gave no value, (f, d)"""
    pending: NDArray[np.float64]
    """inputs of trials under way, (p, d)"""
    admission: Admission | None = None
    """what a trial must satisfy besides; those tried that do not count as failed"""

    @property
    def told(self) -> int:
        """Number of trials that are finished, failed ones included."""
        return len(self.tried) + len(self.failed)

    @property
    def spread(self) -> float:
        """Mean absolute deviation of the values."""
        return float(np.abs(self.observed - self.observed.mean()).mean())


@dataclass(frozen=True)
class Ranking:
    """Orders inputs by their outcome under the input noise."""

    accurate: Perturbations
    coarse: Perturbations
    risk: Risk
    noisy: bool
    """whether observations carry noise, so that the highest one is no incumbent"""
    screened: bool = True
    """whether fewer perturbations and a part of the particles choose which inputs are ranked accurately"""
    finer: Perturbations | None = None
    """what the best one anywhere climbs on by, and what corrects a risk measure; None: nothing"""
    screening: Perturbations | None = None
    """what candidates are screened by; None: the coarse ones"""
    _last: list[tuple[Posterior, NDArray[np.float64], NDArray[np.intp]]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )
    """posterior, tried inputs and their order: of asks between which nothing is told, only the first one ranks"""

    def order(
        self, posterior: Posterior, U: NDArray[np.float64], observed: NDArray[np.float64] | None = None
    ) -> NDArray[np.intp]:
        """Return the indices of U, the input with the best outcome first.

        Observed values (q,) decide where both inputs and observations are exact; of many inputs only those with the
        highest ones are looked at.
        """
        if observed is not None and not self.noisy and self.exact_inputs:
            return np.argsort(-observed, kind="stable")
        if observed is not None and len(U) > CONTENDERS:
            by_value = _latest_of_equals(observed)
            likely = by_value[:CONTENDERS]
            return np.concatenate([likely[self.order(posterior, U[likely])], by_value[CONTENDERS:]])
        first = self._screening(posterior, U) if self.screened else self.measure(posterior, U)
        order = np.argsort(-first, kind="stable")
        top = order[:SHORTLIST]
        order[:SHORTLIST] = top[np.argsort(-self.measure(posterior, U[top]), kind="stable")]
        return order

    def best(
        self,
        posterior: Posterior,
        history: History,
        rng: np.random.Generator,
        admission: Admission | None = None,
    ) -> NDArray[np.float64]:
        """Return the point of the cube (d,) with the best modelled outcome; what was tried guides the search.

        The best of those found climb on by the finer perturbations, by the corrected measure where there is a risk, and
        these decide: a measure by few of them is highest a little beside the best place.
        """
        anchors, unit = history.tried[self.order(posterior, history.tried)[:ANCHORS]], history.spread
        if self.risk.name == "mean":
            finer = self.accurate if self.finer is None else self.finer
            objective, screen, last = (_mean_outcome(posterior, rule) for rule in (self.accurate, self.screen, finer))
        else:
            some = posterior if self.risk.name == "worst" else posterior.thinned(SCREENING_DIVISOR)
            objective = screen = self._expected(some)
            last = objective.corrected(self.correction(posterior))
        found = multistart(objective, screen, anchors.shape[1], anchors, rng, posterior.regions, admission, unit)
        candidates = np.concatenate([anchors[:1], found[:ANCHORS]])
        if self.finer is not None and admission is None:
            candidates, _ = climb(last, candidates, np.zeros_like(candidates), np.ones_like(candidates), unit=unit)
        return candidates[np.argmax(last(candidates))]

    def trials(self, posterior: Posterior, history: History, exactly: bool) -> NDArray[np.intp]:
        """Return the indices of the tried inputs, best first; `exactly`: as if there were no input noise."""
        if exactly:
            return np.argsort(-self._values(posterior, history), kind="stable")
        return self._order_of_tried(posterior, history)

    def shortlist(self, posterior: Posterior, history: History) -> NDArray[np.float64]:
        """Return the best tried inputs (a, d), best first."""
        return history.tried[self._order_of_tried(posterior, history)[:SHORTLIST]]

    def incumbent(self, posterior: Posterior, history: History, scale: Scale) -> tuple[Any, NDArray[np.float64]]:
        """Return the mean to improve upon, a number or (m, 1), one per particle; and the best tried inputs (a, d)."""
        if scale == "exact":
            values = self._values(posterior, history)
            return float(values.max()), history.tried[np.argsort(-values, kind="stable")[:ANCHORS]]
        anchors = history.tried[self._order_of_tried(posterior, history)[:ANCHORS]]
        best = self.accurate.outcome(posterior, anchors[:1]).mean  # (m, 1)
        return best if scale == "robust" else float(best.mean()), anchors

    def believed(self, posterior: Posterior, pending: NDArray[np.float64], scale: Scale) -> Any:
        """Return the best mean that trials under way (p, d) are believed to give, as `incumbent` does.

        Without it a second trial would be sent to the top on which the first one is on its way.
        """
        perturbations = Perturbations(exact(pending.shape[1])) if scale == "exact" else self.accurate
        mean = perturbations.outcome(posterior, pending).mean  # (m, p)
        return mean.mean(axis=0).max() if scale == "unscented" else mean.max(axis=1, keepdims=True)

    def measure(self, posterior: Posterior, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the expected measure (q,) at U (q, d), the mean or a risk measure, which the finer ones correct."""
        if self.risk.name == "mean":
            return self.accurate.outcome(posterior, U).mean.mean(axis=0)
        finer = self.correction(posterior)
        if finer is None:
            return self._expected(posterior).expectation(U)
        return self._expected(posterior.thinned(SCREENING_DIVISOR)).corrected(finer).expectation(U)

    def worth(self, posterior: Posterior, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is stated of U (q, d): as `measure`, of all particles and of draws whose mean is exact, (q,)."""
        if self.risk.name == "mean":
            return self.measure(posterior, U)
        return self._expected(posterior).mirrored().corrected(self.correction(posterior)).expectation(U)

    def judged(
        self, posterior: Posterior, one: NDArray[np.float64], other: NDArray[np.float64]
    ) -> tuple[float, float] | None:
        """Return what two points (d,) are worth by the risk measure; None where the mean decides."""
        if self.risk.name == "mean" or self.exact_inputs:
            return None
        one_is, other_is = self.worth(posterior, np.array([one, other])).tolist()
        return one_is, other_is

    def correction(self, posterior: Posterior) -> Perturbations | None:
        """Return the perturbations that correct a risk measure; None after many trials, of which means are dear."""
        return self.finer if posterior.diagnostics.observations <= CONTENDERS else None

    @property
    def screen(self) -> Perturbations:
        """What candidates are screened by."""
        return self.coarse if self.screening is None else self.screening

    @property
    def exact_inputs(self) -> bool:
        """Whether inputs are reached exactly."""
        return len(self.accurate.quadrature.weights) == 1

    def _expected(self, posterior: Posterior) -> RiskImprovement:
        # The same draws at every call: the ranking must not depend on how often it was asked for.
        return RiskImprovement(posterior, self.accurate, self.risk, None, np.random.default_rng(0))

    def _screening(self, posterior: Posterior, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return about what `measure` does: of what a part of the particles expects, by few perturbations."""
        few = posterior.thinned(SCREENING_DIVISOR)
        if self.risk.name == "mean":
            return self.screen.outcome(few, U).mean.mean(axis=0)
        perturbations = self.coarse if self.correction(posterior) is None else self.accurate
        around = perturbations.around(U)  # (q, s, d)
        mean = means(few, around.reshape(-1, U.shape[1])).mean(axis=0).reshape(around.shape[:2])
        return self.risk.measure(mean, perturbations.quadrature.weights)

    def _order_of_tried(self, posterior: Posterior, history: History) -> NDArray[np.intp]:
        for known, tried, order in self._last:
            if known is posterior and np.array_equal(tried, history.tried):
                return order
        many = len(history.tried) > CONTENDERS
        order = self.order(posterior, history.tried, history.observed if many and not self._exact else None)
        self._last[:] = [(posterior, history.tried, order)]
        return order

    @property
    def _exact(self) -> bool:
        return not self.noisy and self.exact_inputs

    def _values(self, posterior: Posterior, history: History) -> NDArray[np.float64]:
        if not self.noisy:
            return history.observed
        if len(history.tried) <= CONTENDERS:
            return mixture(posterior.moments(history.tried))[0]
        values = np.full(len(history.tried), -np.inf)
        likely = _latest_of_equals(history.observed)[:CONTENDERS]
        values[likely] = mixture(posterior.moments(history.tried[likely]))[0]
        return values


def _latest_of_equals(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the order of values (n,), the highest first; of equal ones the latest, which was chosen by more trials.

    Where trials only succeed or fail, all that succeeded are equal.
    """
    return len(values) - 1 - np.argsort(-values[::-1], kind="stable")


def _mean_outcome(posterior: Posterior, perturbations: Perturbations) -> Acquisition:
    return Acquisition(posterior, CriterionName("ucb", "robust"), perturbations, 0.0, kappa=0.0)
