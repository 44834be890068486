"""The surrogates by name."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import CONSTANT_MEAN_VARIANCE
from surehold.errors import InputError, unknown_name
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName, checked_noise_setting
from surehold.optimization.surrogates.gaussian_process.outputs import checked_range
from surehold.optimization.surrogates.local_global.model import LocalGlobalProcess
from surehold.optimization.surrogates.protocol import Surrogate
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess, least_leaf_width

__all__ = ["DEFAULT_SURROGATE", "SURROGATES", "TELLABLE", "refuse_settings", "surrogate_named"]

SURROGATES: Final = ("two_scales", "gp", "tgp", "local_global")
DEFAULT_SURROGATE: Final = "two_scales"
#: Those that take the observation noise of single trials.
TELLABLE: Final = ("two_scales", "gp", "tgp")


def surrogate_named(
    name: str,
    *,
    noise: float | NoiseName | None = None,
    output_range: tuple[float, float] | None = None,
    input_deviations: NDArray[np.float64],
    seed: int = 0,
) -> Surrogate:
    """Return the surrogate of that name.

    Parameters
    ----------
    noise, output_range
        As of `GaussianProcess`; None where not given: exact observations, an unknown range.
    input_deviations : (d,)
        Standard deviations of the input noise in the unit cube, 0 for exact variables; no leaf of a tree is narrower.
    seed
        Of the chains in the leaves of a tree.

    Raises
    ------
    InputError
        For an unknown name, or settings that the surrogate has not.
    """
    if name not in SURROGATES:
        raise unknown_name("surrogate", name, SURROGATES)
    setting = checked_noise_setting("none" if noise is None else noise)
    if name == "local_global":
        if setting not in ("none", 0.0):
            raise InputError(
                f"noise is {noise!r}, but the surrogate 'local_global' takes exact observations; leave noise= out, or "
                "choose 'two_scales', 'gp' or 'tgp'."
            )
        return LocalGlobalProcess(output_range)
    if name == "two_scales":
        return GaussianProcess(
            kernel="matern52_two_scales", noise=setting, output_range=output_range, mean_variance=CONSTANT_MEAN_VARIANCE
        )
    process = GaussianProcess(noise=setting, output_range=output_range)
    if name == "gp":
        return process
    return TreedGaussianProcess(process=process, margin=least_leaf_width(input_deviations), seed=seed)


def refuse_settings(owner: str, noise: float | NoiseName | None, output_range: tuple[float, float] | None) -> None:
    """Refuse settings of the surrogate beside an `owner` that has its own, so that none is dropped without a word.

    Raises
    ------
    InputError
        If `noise` or `output_range` is given (not None).
    """
    if noise is not None:
        checked_noise_setting(noise)
        raise InputError(f"noise={noise!r} is given beside {owner}, which has its own; leave one out.")
    if output_range is not None:
        checked_range(output_range)
        raise InputError(f"output_range={output_range!r} is given beside {owner}, which has its own; leave one out.")
