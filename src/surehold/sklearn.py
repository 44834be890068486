"""surehold's surrogates as scikit-learn estimators (needs scikit-learn: `pip install surehold[sklearn]`)."""

from abc import abstractmethod
from math import inf
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from surehold.extras import require
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.utils import check_random_state
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError:
    require("sklearn", "surehold.sklearn")
    raise

__all__ = ["GaussianProcessRegressor", "TreedGaussianProcessRegressor"]

Method = Literal["elliptical_slice", "slice", "map"]


class _CubeRegressor(RegressorMixin, BaseEstimator):
    """A regressor that learns on the unit cube of the training data; the surrogate is its concrete classes' part."""

    random_state: Any
    process_: GaussianProcess | TreedGaussianProcess

    @abstractmethod
    def _surrogate(self) -> GaussianProcess | TreedGaussianProcess: ...

    def fit(self, X: Any, y: Any):
        """Fit to X (n, d) and y (n,); returns itself. Raises ValueError for data or settings out of range."""
        X, y = validate_data(self, X, y, y_numeric=True, dtype=np.float64)
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        self.lower_ = X.min(axis=0)
        widths = X.max(axis=0) - self.lower_
        self.widths_ = np.where(widths > 0.0, widths, 1.0)
        self.process_ = self._surrogate().fit((X - self.lower_) / self.widths_, np.asarray(y, dtype=np.float64), seed)
        return self

    def predict(
        self, X: Any, return_std: bool = False
    ) -> NDArray[np.float64] | tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean (q,) at X (q, d) and, where asked for, the standard deviation (q,) of the latent function."""
        check_is_fitted(self)
        return self.process_.predict(self._scaled(X), return_std)

    def noise_std(self, X: Any) -> NDArray[np.float64]:
        """Return the standard deviation of the observation noise (q,) at X (q, d)."""
        check_is_fitted(self)
        return self.process_.noise_std(self._scaled(X))

    def _scaled(self, X: Any) -> NDArray[np.float64]:
        return (validate_data(self, X, reset=False, dtype=np.float64) - self.lower_) / self.widths_


class GaussianProcessRegressor(_CubeRegressor):
    """Gaussian-process regression, hyperparameters integrated out, for scikit-learn's pipelines and model selection.

    Inputs are scaled to the unit cube of the training data and outputs standardized inside.

    Parameters
    ----------
    kernel
        "matern52" (default), "matern32", "squared_exponential", "matern52_product" or "matern52_two_scales".
    noise
        "inferred" (default), "heteroscedastic", "none", or a standard deviation in the outputs' units.
    method
        "elliptical_slice" (default) and "slice" average over particles of the hyperparameters, "map" takes the most
        probable ones: faster.
    particles
        Particles of the slice samplers.
    random_state
        Seed, RandomState or None, as everywhere in scikit-learn.

    Attributes
    ----------
    process_ : GaussianProcess
        What was fitted, on inputs scaled to the unit cube.
    lower_, widths_ : (d,)
        The training data's smallest inputs and ranges (1 where a variable is constant).
    length_scales_ : (m, d)
        Of each particle, in the units of X.

    Examples
    --------
    >>> X = np.linspace(0.0, 10.0, 40)[:, None]
    >>> model = GaussianProcessRegressor(random_state=0).fit(X, np.sin(X[:, 0]))
    >>> bool(model.score(X, np.sin(X[:, 0])) > 0.999)
    True
    """

    def __init__(
        self,
        kernel: str = "matern52",
        *,
        noise: float | NoiseName = "inferred",
        method: Method = "elliptical_slice",
        particles: int = 10,
        random_state: Any = None,
    ):
        self.kernel = kernel
        self.noise: float | NoiseName = noise
        self.method: Method = method
        self.particles = particles
        self.random_state = random_state

    def _surrogate(self) -> GaussianProcess:
        learning = Learning(method=self.method, particles=self.particles)
        return GaussianProcess(kernel=self.kernel, noise=self.noise, learning=learning)

    @property
    def length_scales_(self) -> NDArray[np.float64]:
        """Length-scales of each particle (m, d), in the units of X."""
        check_is_fitted(self)
        posterior = self.process_.posterior
        return cast("GaussianProcessPosterior", posterior).length_scales * self.widths_


class TreedGaussianProcessRegressor(_CubeRegressor):
    """Gaussian processes in the leaves of a regression tree, for scikit-learn's pipelines and model selection.

    For functions that are smooth here and rough there, and for many observations: learning costs about as much for
    every further one. Inputs are scaled to the unit cube of the training data.

    Parameters
    ----------
    min_leaf
        Smallest number of observations in a leaf, 2 or more; "evidence" (default) chooses it.
    weight_power
        By how much the observations of a leaf's ancestors count less for its hyperparameters than its own; inf
        (default) leaves them out.
    trees
        Trees that are averaged, which softens the jumps between leaves.
    kernel, noise, method, particles
        Of the process in a leaf, as for `GaussianProcessRegressor`.
    random_state
        Seed, RandomState or None.

    Attributes
    ----------
    process_ : TreedGaussianProcess
        What was fitted, on inputs scaled to the unit cube.
    lower_, widths_ : (d,)
        The training data's smallest inputs and ranges (1 where a variable is constant).

    Examples
    --------
    >>> X = np.linspace(0.0, 10.0, 200)[:, None]
    >>> y = np.where(X[:, 0] < 5.0, X[:, 0], 5.0 + np.sin(8.0 * X[:, 0]))
    >>> model = TreedGaussianProcessRegressor(min_leaf=20, random_state=0).fit(X, y)
    >>> bool(model.score(X, y) > 0.99)
    True
    """

    def __init__(
        self,
        min_leaf: int | Literal["evidence"] = "evidence",
        weight_power: float = inf,
        *,
        trees: int = 1,
        kernel: str = "matern52",
        noise: float | NoiseName = "inferred",
        method: Method = "elliptical_slice",
        particles: int = 10,
        random_state: Any = None,
    ):
        self.min_leaf: int | Literal["evidence"] = min_leaf
        self.weight_power = weight_power
        self.trees = trees
        self.kernel = kernel
        self.noise: float | NoiseName = noise
        self.method: Method = method
        self.particles = particles
        self.random_state = random_state

    def _surrogate(self) -> TreedGaussianProcess:
        learning = Learning(method=self.method, particles=self.particles)
        process = GaussianProcess(kernel=self.kernel, noise=self.noise, learning=learning)
        return TreedGaussianProcess(self.min_leaf, self.weight_power, process=process, trees=self.trees)
