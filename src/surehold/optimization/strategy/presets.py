"""The thesis' settings beside the defaults.

The thesis fixes the signal variance and a bias in the criterion by hand for every problem, so its preset has one entry
a problem; plain "thesis" takes a signal variance of 1 and no bias. Chains of hyperparameters continue from one step to
the next, as in the original program: a run rebuilt from its history proposes other points than the run itself.
"""

from math import inf
from typing import Final, Literal, NamedTuple

import numpy as np

from surehold.errors import unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Prior
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess

__all__ = ["THESIS", "TREED", "Thesis", "TreedSettings", "thesis_preset"]


class TreedSettings(NamedTuple):
    """Settings of the tree inside an optimizer."""

    min_leaf: int | Literal["evidence"]
    """smallest number of trials in a leaf"""
    weight_power: float = inf
    """by how much the trials of a leaf's ancestors count less"""
    continued: bool = False
    """whether chains continue from step to step"""
    trees: int = 1
    """trees that are averaged"""

    def surrogate(
        self, process: GaussianProcess, box: Box, input_noise: InputNoise | None, seed: int
    ) -> TreedGaussianProcess:
        """Return the tree of such processes.

        No leaf is narrower than the input noise's standard deviation, or 0.01 box widths where there is none.
        """
        margin = np.full(box.dimension, 0.01)
        if input_noise is not None:
            deviation = np.sqrt(np.diag(input_noise.unit_covariance(box)))
            margin = np.where(deviation > 0.0, np.minimum(deviation, 0.49), margin)
        return TreedGaussianProcess(
            self.min_leaf,
            self.weight_power,
            process=process,
            trees=self.trees,
            margin=margin,
            continued=self.continued,
            seed=seed,
        )


TREED: Final = TreedSettings(min_leaf=15)


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
