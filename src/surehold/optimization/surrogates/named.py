"""The surrogates by name."""

from typing import Final

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.strategy.presets import TREED, TreedSettings
from surehold.optimization.strategy.thesis import ThesisConstants
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess, NoiseName
from surehold.optimization.surrogates.local_global import LocalGlobalProcess
from surehold.optimization.surrogates.protocol import Surrogate

__all__ = ["SURROGATES", "surrogate_named"]

SURROGATES: Final = ("gp", "tgp", "local_global")


def surrogate_named(
    name: str,
    box: Box,
    input_noise: InputNoise | None,
    seed: int,
    noise: float | NoiseName,
    output_range: tuple[float, float] | None,
    thesis: ThesisConstants | None,
) -> Surrogate:
    """Return the surrogate of that name; arguments as of `Optimizer`, `thesis` the constants of a preset.

    Raises
    ------
    InputError
        For an unknown name, or settings that the surrogate has not.
    """
    if name not in SURROGATES:
        raise unknown_name("surrogate", name, SURROGATES)
    if name == "local_global":
        if thesis is not None or noise not in ("none", 0.0):
            raise InputError(
                "surrogate 'local_global' has no preset and takes exact observations; leave preset= and noise= out, "
                "or choose 'gp' or 'tgp'."
            )
        return LocalGlobalProcess(output_range)
    process = GaussianProcess(noise=noise, output_range=output_range) if thesis is None else thesis.gaussian_process()
    if name == "gp":
        return process
    tree = TREED if thesis is None else TreedSettings(thesis.min_leaf, continued=True)
    return tree.surrogate(process, box, input_noise, seed)
