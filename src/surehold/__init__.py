"""surehold: find, in few trials, the optimum that still holds when the input shakes.

The public names below are imported when they are first used, so that `import surehold` stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold import grasping, problems
    from surehold.errors import InputError, SureholdError
    from surehold.optimization.acquisition.risk_measures import Risk
    from surehold.optimization.box import Box
    from surehold.optimization.maximization import Result, Trial, maximize, minimize
    from surehold.optimization.noise.input_noise import InputNoise
    from surehold.optimization.noise.quadratures import sigma_points
    from surehold.optimization.optimizer import Optimizer
    from surehold.optimization.recommendation import Recommendation
    from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
    from surehold.optimization.surrogates.treed.model import TreedGaussianProcess
    from surehold.optimization.trials import AskedTrial
    from surehold.studies.sampler import Sampler

__version__ = "0.1.0"

__all__ = [
    "AskedTrial",
    "Box",
    "GaussianProcess",
    "InputError",
    "InputNoise",
    "Optimizer",
    "Recommendation",
    "Result",
    "Risk",
    "Sampler",
    "SureholdError",
    "TreedGaussianProcess",
    "Trial",
    "grasping",
    "maximize",
    "minimize",
    "problems",
    "sigma_points",
]

_HOMES = {
    "AskedTrial": "optimization.trials",
    "Box": "optimization.box",
    "GaussianProcess": "optimization.surrogates.gaussian_process.model",
    "InputError": "errors",
    "InputNoise": "optimization.noise.input_noise",
    "Optimizer": "optimization.optimizer",
    "Recommendation": "optimization.recommendation",
    "Risk": "optimization.acquisition.risk_measures",
    "Result": "optimization.maximization",
    "Sampler": "studies.sampler",
    "SureholdError": "errors",
    "TreedGaussianProcess": "optimization.surrogates.treed.model",
    "Trial": "optimization.maximization",
    "maximize": "optimization.maximization",
    "minimize": "optimization.maximization",
    "sigma_points": "optimization.noise.quadratures",
}


def __getattr__(name: str) -> Any:
    if name in ("grasping", "problems"):
        return import_module(f"surehold.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'surehold' has no attribute {name!r}; it has {', '.join(__all__)}")
    value = getattr(import_module(f"surehold.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
