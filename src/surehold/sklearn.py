"""surehold's surrogates as scikit-learn estimators (needs scikit-learn: `pip install surehold[sklearn]`)."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.utils import check_random_state
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:
    raise ImportError("surehold.sklearn needs scikit-learn; install it with: pip install surehold[sklearn]") from error

from surehold.optimization.gaussian_process import GaussianProcess, NoiseName
from surehold.optimization.hyperparameters import Learning

__all__ = ["GaussianProcessRegressor"]


class GaussianProcessRegressor(RegressorMixin, BaseEstimator):
    """Gaussian-process regression, hyperparameters integrated out, for scikit-learn's pipelines and model selection.

    Inputs are scaled to the unit cube of the training data and outputs standardized inside.

    Parameters
    ----------
    kernel
        "matern52" (default), "matern32", "squared_exponential" or "matern52_product".
    noise
        "inferred" (default), "heteroscedastic", "none", or a standard deviation in the outputs' units.
    method
        "slice" (default) averages over particles of the hyperparameters, "map" takes the most probable ones: faster.
    particles
        Particles of "slice".
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
        method: Literal["slice", "map"] = "slice",
        particles: int = 10,
        random_state: Any = None,
    ):
        self.kernel = kernel
        self.noise: float | NoiseName = noise
        self.method: Literal["slice", "map"] = method
        self.particles = particles
        self.random_state = random_state

    def fit(self, X: Any, y: Any) -> "GaussianProcessRegressor":
        """Fit to X (n, d) and y (n,); returns itself. Raises ValueError for data or settings out of range."""
        X, y = validate_data(self, X, y, y_numeric=True, dtype=np.float64)
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        self.lower_ = X.min(axis=0)
        widths = X.max(axis=0) - self.lower_
        self.widths_ = np.where(widths > 0.0, widths, 1.0)
        learning = Learning(method=self.method, particles=self.particles)
        process = GaussianProcess(kernel=self.kernel, noise=self.noise, learning=learning)
        self.process_ = process.fit((X - self.lower_) / self.widths_, np.asarray(y, dtype=np.float64), seed)
        self.length_scales_ = self.process_.posterior.length_scales * self.widths_
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
