"""The thesis' settings beside the defaults.

The thesis fixes the signal variance and a bias in the criterion by hand for every problem, so its preset has one entry
a problem; plain "thesis" takes a signal variance of 1 and no bias. Chains of hyperparameters continue from one step to
the next, as in the original program: a run rebuilt from its history proposes other points than the run itself.
"""

from math import inf
from typing import Final, Literal, NamedTuple

import numpy as np

from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess

__all__ = ["TREED", "TreedSettings"]


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
