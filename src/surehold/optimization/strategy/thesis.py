"""The thesis' way to choose the next trial, with the constants that it sets by hand for every problem.

The criterion is maximized by DIRECT, and the improvement is measured from the highest observed value, under input noise
too. Chains of hyperparameters continue from one trial to the next, as in the original program: a run rebuilt from its
history proposes other points than the run itself.
"""

from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import THESIS_REPEATS
from surehold.errors import unknown_name
from surehold.optimization.acquisition.scales import Acquisition, CriterionName
from surehold.optimization.maximizer.direct import divide_and_climb
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Prior
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["PRESETS", "ThesisConstants", "ThesisImprovement", "thesis_preset"]


class ThesisConstants(NamedTuple):
    """What the thesis sets by hand for a problem."""

    signal_variance: float = 1.0
    """[sigma_p], used as a variance"""
    ratio: float = 1e-6
    """[sigma_n], nugget as a fraction of the signal variance"""
    margin: float = 0.0
    """[xi], 0.01 / sigma_p as the original program divided it"""
    min_leaf: int = 20
    """[s_l], smallest number of samples in a leaf of the tree"""

    def gaussian_process(self) -> GaussianProcess:
        """Return the thesis' Gaussian process: zero mean, flat prior, 100 + 10 slice sweeps (spec of its section 3)."""
        return GaussianProcess(
            signal_variance=self.signal_variance,
            ratio=self.ratio,
            standardize=False,
            prior=Prior(log_length_scale=(1.0, 10.0)),
            learning=Learning("slice", particles=10, burn_in=100, thin=1, width=6.0),
        )


PRESETS: Final = {
    "thesis": ThesisConstants(),
    "thesis-rkhs": ThesisConstants(3.93, 1e-6, 0.0025, 8),
    "thesis-gf": ThesisConstants(0.40, 1e-6, 0.025, 15),
    "thesis-gm": ThesisConstants(0.0642, 1e-6, 0.1558, 15),
    "thesis-gm-printed": ThesisConstants(0.642, 1e-6, 0.0156, 15),
    "thesis-gm-noise": ThesisConstants(0.642, 1e-6, 0.0, 15),
    "thesis-grasp": ThesisConstants(0.35, 1e-4, 0.0, 20),
}


def thesis_preset(name: str) -> ThesisConstants:
    """Return the constants of a preset; raises InputError for an unknown name."""
    if name not in PRESETS:
        raise unknown_name("preset", name, PRESETS)
    return PRESETS[name]


@dataclass(frozen=True)
class ThesisImprovement:
    """The strategy of the thesis presets."""

    ranking: Ranking
    criterion: CriterionName
    margin: float
    """improvement that does not count, in the outputs' units"""
    kappa: float
    """standard deviations of the upper confidence bound"""

    repeats: ClassVar[int] = THESIS_REPEATS
    continues_chains: ClassVar[bool] = True

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the next trial as the only candidate, (1, d)."""
        scale = self.criterion.scale
        best, anchors = self.ranking.incumbent(posterior, history, scale)
        if scale != "exact":  # the original improves upon the highest observed value inside UEI too
            best = float(history.observed.max())
        if len(history.pending):
            posterior = posterior.with_pending(history.pending)
            best = np.maximum(best, self.ranking.believed(posterior, history.pending, scale))
        d = anchors.shape[1]
        perturbations = Perturbations(exact(d)) if scale == "exact" else self.ranking.accurate
        acquisition = Acquisition(posterior, self.criterion, perturbations, best, margin=self.margin, kappa=self.kappa)
        return divide_and_climb(acquisition, d, anchors[0], rng, posterior.regions)[:1]
