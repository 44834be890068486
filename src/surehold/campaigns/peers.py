"""Other libraries' optimizers as methods of a campaign: `ask() -> u (d,)`, `tell(u, y)` on the unit cube, maximizing.

Each takes (dimension, initial design (n, d), seed) and is used with its own defaults. `answer` is the input that it
would return: the highest observed, unless the library models the input noise itself.
"""

# pyright: reportMissingImports=false
# The libraries belong to the extra `peers`, which a checkout that is checked need not have.

import importlib.util
import warnings
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.botorch_methods import BoTorch, BoTorchTrustRegion
from surehold.campaigns.told import Told

__all__ = ["PEERS", "REQUIRES", "installed_peers"]

Array = NDArray[np.float64]


class Optuna:
    """An Optuna sampler by name."""

    def __init__(self, dimension: int, initial: Array, seed: int, sampler: str = "GPSampler"):
        import optuna

        _one_torch_thread()
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        options = {"n_startup_trials": len(initial)} if sampler != "CmaEsSampler" else {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            chosen = getattr(optuna.samplers, sampler)(seed=seed, **options)
        self._study = optuna.create_study(direction="maximize", sampler=chosen)
        self._space = {f"x{i}": optuna.distributions.FloatDistribution(0.0, 1.0) for i in range(dimension)}
        for u in initial:
            self._study.enqueue_trial({name: float(value) for name, value in zip(self._space, u, strict=True)})
        self._told = Told(initial)

    def ask(self) -> Array:
        """Return the next trial."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._trial = self._study.ask(dict(self._space))
        return np.array([self._trial.params[name] for name in self._space])

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        self._study.tell(self._trial, y)
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._told.best()


class BayesianOptimization:
    """The package bayesian-optimization with expected improvement."""

    def __init__(self, dimension: int, initial: Array, seed: int):
        from bayes_opt import BayesianOptimization, acquisition

        self._names = [f"x{i}" for i in range(dimension)]
        self._optimizer = BayesianOptimization(
            None,
            dict.fromkeys(self._names, (0.0, 1.0)),
            acquisition_function=acquisition.ExpectedImprovement(xi=0.0),
            random_state=seed,
            verbose=0,
            allow_duplicate_points=True,
        )
        self._told = Told(initial)

    def ask(self) -> Array:
        """Return the next trial."""
        if self._told.waiting:
            return self._told.waiting.pop(0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = self._optimizer.suggest()
        return np.array([found[name] for name in self._names])

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        self._optimizer.register(params=dict(zip(self._names, map(float, u), strict=True)), target=y)
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._told.best()


class ScikitOptimize:
    """The package scikit-optimize, Gaussian process with expected improvement."""

    def __init__(self, dimension: int, initial: Array, seed: int):
        from skopt import Optimizer

        self._optimizer = Optimizer(
            [(0.0, 1.0)] * dimension, "gp", n_initial_points=len(initial), acq_func="EI", random_state=seed
        )
        self._told = Told(initial)

    def ask(self) -> Array:
        """Return the next trial."""
        if self._told.waiting:
            return self._told.waiting.pop(0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.array(self._optimizer.ask())

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._optimizer.tell([float(value) for value in u], -y)
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._told.best()


class RandomSearch:
    """Uniform draws."""

    def __init__(self, dimension: int, initial: Array, seed: int):
        self._rng = np.random.default_rng([seed, 1])
        self._dimension = dimension
        self._told = Told(initial)

    def ask(self) -> Array:
        """Return the next trial."""
        return self._told.waiting.pop(0) if self._told.waiting else self._rng.random(self._dimension)

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._told.best()


#: Maker of each peer by name; the keyword `perturbations` goes to those that can be told of the input noise.
PEERS: Final[dict[str, Callable[..., Any]]] = {
    "optuna-gp": Optuna,
    "optuna-tpe": lambda d, initial, seed: Optuna(d, initial, seed, "TPESampler"),
    "optuna-cma-es": lambda d, initial, seed: Optuna(d, initial, seed, "CmaEsSampler"),
    "bayesian-optimization": BayesianOptimization,
    "scikit-optimize": ScikitOptimize,
    "botorch": BoTorch,
    "botorch-turbo": BoTorchTrustRegion,
    "random": RandomSearch,
}
#: Modules that a peer needs.
REQUIRES: Final[dict[str, tuple[str, ...]]] = {
    "optuna-gp": ("optuna", "torch"),
    "optuna-tpe": ("optuna",),
    "optuna-cma-es": ("optuna", "cmaes"),
    "bayesian-optimization": ("bayes_opt",),
    "scikit-optimize": ("skopt",),
    "botorch": ("botorch",),
    "botorch-turbo": ("botorch",),
    "random": (),
}


def installed_peers() -> dict[str, Callable[..., Any]]:
    """Return the makers of the peers whose libraries are installed."""
    return {
        name: maker
        for name, maker in PEERS.items()
        if all(importlib.util.find_spec(module) for module in REQUIRES[name])
    }


def _one_torch_thread() -> None:
    if importlib.util.find_spec("torch"):
        import torch

        torch.set_num_threads(1)
