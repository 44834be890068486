"""Other optimizers behind one interface: `ask() -> u (d,)`, `tell(u, y)` on the unit cube, everything maximized.

Each takes (dimension, initial design (n, d), seed) and is used with its own defaults. A library that is not installed
is left out of every table (`pip install '.[peers]'` brings them all).
"""

import importlib.util
import warnings

import numpy as np

import surehold as sh


class Surehold:
    """surehold; `settings` go to the optimizer."""

    def __init__(self, dimension, initial, seed, **settings):
        self._optimizer = sh.Optimizer(sh.Box.unit(dimension), n_initial=len(initial), seed=seed, **settings)
        self._initial = list(initial)

    def ask(self):
        return self._initial.pop(0) if self._initial else self._optimizer.ask()

    def tell(self, u, y):
        self._optimizer.tell(u, y)


class Optuna:
    """An Optuna sampler by name."""

    def __init__(self, dimension, initial, seed, sampler="GPSampler"):
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        options = {"n_startup_trials": len(initial)} if sampler != "CmaEsSampler" else {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            chosen = getattr(optuna.samplers, sampler)(seed=seed, **options)
        self._study = optuna.create_study(direction="maximize", sampler=chosen)
        self._space = {f"x{i}": optuna.distributions.FloatDistribution(0.0, 1.0) for i in range(dimension)}
        for u in initial:
            self._study.enqueue_trial({name: float(value) for name, value in zip(self._space, u, strict=True)})

    def ask(self):
        self._trial = self._study.ask(self._space)
        return np.array([self._trial.params[name] for name in self._space])

    def tell(self, u, y):
        self._study.tell(self._trial, y)


class BayesianOptimization:
    """The package bayesian-optimization with expected improvement."""

    def __init__(self, dimension, initial, seed):
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
        self._initial = list(initial)

    def ask(self):
        if self._initial:
            return self._initial.pop(0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = self._optimizer.suggest()
        return np.array([found[name] for name in self._names])

    def tell(self, u, y):
        self._optimizer.register(params=dict(zip(self._names, map(float, u), strict=True)), target=y)


class ScikitOptimize:
    """The package scikit-optimize, Gaussian process with expected improvement."""

    def __init__(self, dimension, initial, seed):
        from skopt import Optimizer

        self._optimizer = Optimizer(
            [(0.0, 1.0)] * dimension, "gp", n_initial_points=len(initial), acq_func="EI", random_state=seed
        )
        self._initial = list(initial)

    def ask(self):
        if self._initial:
            return self._initial.pop(0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.array(self._optimizer.ask())

    def tell(self, u, y):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._optimizer.tell([float(value) for value in u], -y)


class BoTorch:
    """BoTorch: SingleTaskGP and LogExpectedImprovement."""

    def __init__(self, dimension, initial, seed):
        import torch

        torch.manual_seed(seed)
        torch.set_num_threads(1)
        self._dimension = dimension
        self._initial = list(initial)
        self._X, self._y = [], []

    def ask(self):
        if self._initial:
            return self._initial.pop(0)
        import torch
        from botorch.acquisition import LogExpectedImprovement
        from botorch.fit import fit_gpytorch_mll
        from botorch.models import SingleTaskGP
        from botorch.optim import optimize_acqf
        from gpytorch.mlls import ExactMarginalLogLikelihood

        X = torch.tensor(np.array(self._X))
        y = torch.tensor(np.array(self._y))[:, None]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = SingleTaskGP(X, y)
            fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
            bounds = torch.stack([torch.zeros(self._dimension), torch.ones(self._dimension)]).to(X)
            found, _ = optimize_acqf(
                LogExpectedImprovement(model, best_f=y.max()), bounds, q=1, num_restarts=10, raw_samples=256
            )
        return found[0].numpy()

    def tell(self, u, y):
        self._X.append(np.asarray(u, dtype=np.float64))
        self._y.append(y)


class RandomSearch:
    """Uniform draws."""

    def __init__(self, dimension, initial, seed):
        self._initial = list(initial)
        self._rng = np.random.default_rng([seed, 1])
        self._dimension = dimension

    def ask(self):
        return self._initial.pop(0) if self._initial else self._rng.random(self._dimension)

    def tell(self, u, y):
        pass


_REQUIRES = {
    "Optuna GPSampler": ("optuna", "torch"),
    "Optuna TPE": ("optuna",),
    "bayesian-optimization": ("bayes_opt",),
    "scikit-optimize": ("skopt",),
    "BoTorch LogEI": ("botorch",),
    "random search": (),
}
_MAKERS = {
    "Optuna GPSampler": Optuna,
    "Optuna TPE": lambda d, initial, seed: Optuna(d, initial, seed, "TPESampler"),
    "bayesian-optimization": BayesianOptimization,
    "scikit-optimize": ScikitOptimize,
    "BoTorch LogEI": BoTorch,
    "random search": RandomSearch,
}


def peers():
    """Return {name: maker} of the peers that are installed."""
    return {
        name: maker
        for name, maker in _MAKERS.items()
        if all(importlib.util.find_spec(module) for module in _REQUIRES[name])
    }
