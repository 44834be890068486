"""The thesis' settings beside the defaults.

The thesis fixes the signal variance and a bias in the criterion by hand for every problem, so its preset has one entry
a problem; plain "thesis" takes a signal variance of 1 and no bias. Chains of hyperparameters continue from one step to
the next, as in the original program: a run rebuilt from its history proposes other points than the run itself.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import unknown_name
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Prior
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess, least_leaf_width

__all__ = ["THESIS", "Thesis", "thesis_preset"]


class Thesis(NamedTuple):
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

    def tree(self, input_deviations: NDArray[np.float64], seed: int = 0, **changes: Any) -> TreedGaussianProcess:
        """Return the thesis' treed Gaussian process; arguments as of `surrogate_named`, `changes` of the tree."""
        settings = {"min_leaf": self.min_leaf, "continued": True, **changes}
        margin = least_leaf_width(input_deviations)
        return TreedGaussianProcess(process=self.gaussian_process(), margin=margin, seed=seed, **settings)

    def surrogate(
        self, name: str, input_deviations: NDArray[np.float64], seed: int = 0
    ) -> GaussianProcess | TreedGaussianProcess:
        """Return the thesis' surrogate of that name, "gp" or "tgp"; raises InputError for another one."""
        if name not in ("gp", "tgp"):
            raise unknown_name("surrogate of a thesis preset", name, ("gp", "tgp"))
        return self.gaussian_process() if name == "gp" else self.tree(input_deviations, seed)


THESIS: Final = {
    "thesis": Thesis(),
    "thesis-rkhs": Thesis(3.93, 1e-6, 0.0025, 8),
    "thesis-gf": Thesis(0.40, 1e-6, 0.025, 15),
    "thesis-gm": Thesis(0.0642, 1e-6, 0.1558, 15),
    "thesis-gm-printed": Thesis(0.642, 1e-6, 0.0156, 15),
    "thesis-gm-noise": Thesis(0.642, 1e-6, 0.0, 15),
    "thesis-grasp": Thesis(0.35, 1e-4, 0.0, 20),
}


def thesis_preset(name: str) -> Thesis:
    """Return the constants of a preset; raises InputError for an unknown name."""
    if name not in THESIS:
        raise unknown_name("preset", name, THESIS)
    return THESIS[name]
