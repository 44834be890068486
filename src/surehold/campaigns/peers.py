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

__all__ = ["PEERS", "REQUIRES", "installed_peers"]

Array = NDArray[np.float64]


class _Told:
    """The initial design, and what was told."""

    def __init__(self, initial: Array):
        self.waiting = list(initial)
        self.X: list[Array] = []
        self.y: list[float] = []

    def add(self, u: Array, y: float) -> None:
        self.X.append(np.asarray(u, dtype=np.float64))
        self.y.append(y)

    def best(self) -> Array:
        return self.X[int(np.argmax(self.y))]


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
        self._told = _Told(initial)

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
        self._told = _Told(initial)

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
        self._told = _Told(initial)

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


class BoTorch:
    """BoTorch: SingleTaskGP and LogExpectedImprovement; with the noise known, its input perturbation.

    With `root` (d, d) of the noise's covariance in the unit cube (`bounded` for uniform noise) the model averages over
    16 quasi-random perturbations, the criterion is the expected improvement of that average, and the answer the
    observed input with the best one.
    """

    def __init__(self, dimension: int, initial: Array, seed: int, root: Array | None = None, bounded: bool = False):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # importing it warns
            import torch
            from botorch.acquisition.objective import ExpectationPosteriorTransform

        _one_torch_thread()
        torch.manual_seed(seed)
        self._shifts = self._average = None
        if root is not None:
            from scipy.special import ndtr
            from scipy.stats import qmc

            normals = qmc.MultivariateNormalQMC(np.zeros(dimension), rng=np.random.default_rng(seed)).random(16)
            standard = 3.0**0.5 * (2.0 * ndtr(normals) - 1.0) if bounded else normals
            self._shifts = torch.tensor(standard @ root.T)
            self._average = ExpectationPosteriorTransform(n_w=len(normals))
        self._told = _Told(initial)
        self._model: tuple[int, Any] | None = None

    def ask(self) -> Array:
        """Return the next trial."""
        if self._told.waiting:
            return self._told.waiting.pop(0)
        import torch

        X = torch.tensor(np.array(self._told.X))
        best = max(self._told.y) if self._shifts is None else float(self._averages().max())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from botorch.acquisition import LogExpectedImprovement
            from botorch.optim import optimize_acqf

            criterion = LogExpectedImprovement(self._fitted(), best, posterior_transform=self._average)
            bounds = torch.stack([torch.zeros(X.shape[1]), torch.ones(X.shape[1])]).to(X)
            found, _ = optimize_acqf(criterion, bounds, q=1, num_restarts=10, raw_samples=256)
        return found[0].numpy()

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed; with the noise known, the observed input whose average is expected best."""
        if self._shifts is None:
            return self._told.best()
        return self._told.X[int(self._averages().argmax())]

    def _averages(self) -> Any:
        import torch

        model = self._fitted()
        with torch.no_grad(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            posterior = model.posterior(
                torch.tensor(np.array(self._told.X))[:, None], posterior_transform=self._average
            )
        return posterior.mean.reshape(-1)

    def _fitted(self) -> Any:
        n = len(self._told.y)
        if self._model is None or self._model[0] != n:
            import torch

            y = torch.tensor(np.array(self._told.y))[:, None]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                from botorch.fit import fit_gpytorch_mll
                from botorch.models import SingleTaskGP
                from botorch.models.transforms.input import InputPerturbation
                from gpytorch.mlls import ExactMarginalLogLikelihood

                transform = None if self._shifts is None else InputPerturbation(self._shifts)
                model = SingleTaskGP(torch.tensor(np.array(self._told.X)), y, input_transform=transform)
                fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
                model.eval()
            self._model = (n, model)
        return self._model[1]


class RandomSearch:
    """Uniform draws."""

    def __init__(self, dimension: int, initial: Array, seed: int):
        self._rng = np.random.default_rng([seed, 1])
        self._dimension = dimension
        self._told = _Told(initial)

    def ask(self) -> Array:
        """Return the next trial."""
        return self._told.waiting.pop(0) if self._told.waiting else self._rng.random(self._dimension)

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        self._told.add(u, y)

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._told.best()


#: Maker of each peer by name; the keywords `root` and `bounded` go to those that can be told of the input noise.
PEERS: Final[dict[str, Callable[..., Any]]] = {
    "optuna-gp": Optuna,
    "optuna-tpe": lambda d, initial, seed: Optuna(d, initial, seed, "TPESampler"),
    "optuna-cma-es": lambda d, initial, seed: Optuna(d, initial, seed, "CmaEsSampler"),
    "bayesian-optimization": BayesianOptimization,
    "scikit-optimize": ScikitOptimize,
    "botorch": BoTorch,
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
