"""BoTorch as methods of a campaign, see `peers`: its default, and a trust region after Eriksson et al. 2019."""

# pyright: reportMissingImports=false
# The libraries belong to the extra `peers`, which a checkout that is checked need not have.

import warnings
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.told import Told

__all__ = ["BoTorch", "BoTorchTrustRegion"]

Array = NDArray[np.float64]

_FIRST, _SMALLEST, _LARGEST = 0.8, 0.5**7, 1.6  # side of the trust region, before it is stretched
_SUCCESSES: Final = 10  # in a row, that double it; as many failures as there are variables halve it
_BETTER: Final = 1e-3  # share of the best value by which a success is better
_CANDIDATES: Final = 2000
_COUNTED: Final = 20  # variables of the best trial that a candidate changes, in the mean


class BoTorch:
    """BoTorch: SingleTaskGP and LogExpectedImprovement; with the noise known, its input perturbation.

    With `perturbations` (s, d) of the unit cube the model averages over them, the criterion is the expected improvement
    of that average, and the answer the observed input with the best one. `clips`: perturbed inputs are moved
    back to the border of the cube.
    """

    def __init__(
        self, dimension: int, initial: Array, seed: int, perturbations: Array | None = None, clips: bool = False
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # importing it warns
            import torch
            from botorch.acquisition.objective import ExpectationPosteriorTransform

        torch.set_num_threads(1)
        torch.manual_seed(seed)
        self._shifts = self._average = None
        if perturbations is not None:
            self._shifts = torch.tensor(perturbations)
            self._average = ExpectationPosteriorTransform(n_w=len(perturbations))
        self._clips = clips
        self._told = Told(initial)
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

                cube = torch.tensor([[0.0], [1.0]]).expand(2, len(self._told.X[0])) if self._clips else None
                transform = None if self._shifts is None else InputPerturbation(self._shifts, bounds=cube)
                model = SingleTaskGP(torch.tensor(np.array(self._told.X)), y, input_transform=transform)
                fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
                model.eval()
            self._model = (n, model)
        return self._model[1]


class BoTorchTrustRegion:
    """TuRBO-1 (Eriksson et al. 2019): Thompson sampling in a box that moves.

    The box lies around the highest trial, its sides in proportion to the length-scales. Candidates change some of the
    best trial's variables; the one that is highest in a draw from the posterior is tried. Once the box is too small,
    the search begins anew with as many random trials as the initial design has. Constants are those of BoTorch's
    tutorial, but for 2,000 candidates in place of up to 5,000: what a draw takes grows with their cube.
    """

    def __init__(self, dimension: int, initial: Array, seed: int):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # importing it warns
            import torch
            from torch.quasirandom import SobolEngine

        torch.set_num_threads(1)
        torch.manual_seed(seed)
        self._sobol = SobolEngine(dimension, scramble=True, seed=seed)
        self._initial = len(initial)
        self._all, self._told = Told(initial), Told(initial)
        self._side, self._successes, self._failures = _FIRST, 0, 0

    def ask(self) -> Array:
        """Return the next trial."""
        if self._told.waiting:
            return self._told.waiting.pop(0)
        import torch

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from botorch.generation import MaxPosteriorSampling

            X, y = torch.tensor(np.array(self._told.X)), torch.tensor(np.array(self._told.y))[:, None]
            model = _scaled_model(X, (y - y.mean()) / y.std().clamp_min(1e-12))
            scales = model.covar_module.base_kernel.lengthscale.detach().reshape(-1)
            half = 0.5 * self._side * scales / scales.log().mean().exp()
            candidates = self._candidates(X[int(y.argmax())], half)
            with torch.no_grad():
                return MaxPosteriorSampling(model, replacement=False)(candidates, num_samples=1)[0].numpy()

    def _candidates(self, best: Any, half: Any) -> Any:
        """Return candidates (q, d) within `half` (d,) of the best trial (d,)."""
        import torch

        d = len(best)
        low, high = (best - half).clamp(0.0, 1.0), (best + half).clamp(0.0, 1.0)
        places = low + (high - low) * self._sobol.draw(_CANDIDATES).to(best)
        changed = torch.rand(places.shape, dtype=best.dtype) <= min(_COUNTED / d, 1.0)
        none = torch.where(changed.sum(dim=1) == 0)[0]
        changed[none, torch.randint(0, d, (len(none),))] = True
        return torch.where(changed, places, best)

    def tell(self, u: Array, y: float) -> None:
        """Record a trial."""
        guided = len(self._told.y) >= self._initial
        better = guided and y > max(self._told.y) + _BETTER * abs(max(self._told.y))
        self._told.add(u, y)
        self._all.add(u, y)
        if not guided:
            return
        self._successes, self._failures = (self._successes + 1, 0) if better else (0, self._failures + 1)
        if self._successes == _SUCCESSES:
            self._side, self._successes = min(2.0 * self._side, _LARGEST), 0
        elif self._failures == max(4, len(u)):
            self._side, self._failures = 0.5 * self._side, 0
        if self._side < _SMALLEST:
            self._told = Told(self._sobol.draw(self._initial).numpy().astype(np.float64))
            self._side, self._successes, self._failures = _FIRST, 0, 0

    def answer(self) -> Array:
        """Return the highest observed."""
        return self._all.best()


def _scaled_model(X: Any, y: Any) -> Any:
    """Return a Gaussian process fitted to X (n, d) and standardized y (n, 1), within the tutorial's bounds."""
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from gpytorch.constraints import Interval
    from gpytorch.kernels import MaternKernel, ScaleKernel
    from gpytorch.likelihoods import GaussianLikelihood
    from gpytorch.mlls import ExactMarginalLogLikelihood

    kernel = MaternKernel(nu=2.5, ard_num_dims=X.shape[1], lengthscale_constraint=Interval(0.005, 4.0))
    likelihood = GaussianLikelihood(noise_constraint=Interval(1e-8, 1e-3))
    model = SingleTaskGP(X, y, covar_module=ScaleKernel(kernel), likelihood=likelihood)
    fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
    return model.eval()
