"""The models of further outputs, such as a torque: one Gaussian process each, and how far trials missed the limits.

Legend: t trials, o outputs in the order of the limits, c of them that have a limit; the others are watched only
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.box import Box
from surehold.optimization.lattice import Lattice
from surehold.optimization.limits import Limit
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.response_model import ResponseModel
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName
from surehold.optimization.surrogates.protocol import Posterior
from surehold.optimization.trials import Trials

__all__ = ["OutputModels"]


class OutputModels:
    """See above; arguments as of `Requirements`; `cautious`: whether no limit is to be broken while exploring."""

    def __init__(
        self,
        box: Box,
        limits: tuple[Limit, ...],
        *,
        cautious: bool,
        straying: InputNoise | None,
        noise: NoiseName,
        lattice: Lattice | None,
        seed: int,
    ):
        self.limits: Final = limits
        self.limited: Final = tuple(limit for limit in limits if not limit.watched)
        self._columns: Final = [k for k, limit in enumerate(limits) if not limit.watched]
        self._box: Final = box
        self._cautious: Final = cautious
        self._straying: Final = straying
        self._noise: Final[NoiseName] = noise
        self._lattice: Final = lattice
        self._seed: Final = seed
        self._models: Final = {k: self._model(GaussianProcess(noise=noise), k) for k in range(len(limits))}
        self._known: Final[dict[int, tuple[int, Posterior]]] = {}

    def forget(self) -> None:
        """Drop what was learnt: the trials are others from now on."""
        for model in self._models.values():
            model.forget()
        self._known.clear()

    def told(self, trials: Trials) -> NDArray[np.float64]:
        """Return the outputs that have a limit, (t, c); NaN where one was not measured."""
        return trials.outputs[:, self._columns]

    def missed(self, trials: Trials) -> NDArray[np.float64]:
        """Return by how much these are beyond their limits, negative inside, (t, c)."""
        told = self.told(trials)
        columns = [limit.missed_by(told[:, i]) for i, limit in enumerate(self.limited)]
        return np.reshape(columns, (len(columns), len(told))).T

    def beyond(self, trials: Trials) -> NDArray[np.float64]:
        """Return the largest miss of each trial in ranges of that output, (t,); NaN where not all was measured."""
        told = self.told(trials)
        measured = told[np.isfinite(told).all(axis=1)]
        scale = np.ptp(measured, axis=0) if len(measured) else np.ones(told.shape[1])
        return (np.maximum(self.missed(trials), 0.0) / np.where(scale > 0.0, scale, 1.0)).max(axis=1, initial=0.0)

    def unmeasured(self, trials: Trials) -> list[str]:
        """Return the names of limited outputs that no trial has measured."""
        measured = self._measured(trials)
        return [self.limits[k].name for k in self._columns if k not in measured]

    def all(self, trials: Trials) -> dict[str, Posterior]:
        """Return the models of all outputs that have been measured, watched ones included, by name."""
        return {self.limits[k].name: self._posterior(trials, k) for k in self._measured(trials)}

    def required(self, trials: Trials) -> list[tuple[Posterior, Limit]]:
        """Return the models of those that have a limit and have been measured, each with its limit."""
        return [(self._posterior(trials, k), self.limits[k]) for k in self._measured(trials) if k in self._columns]

    @staticmethod
    def _measured(trials: Trials) -> list[int]:
        return np.flatnonzero(np.isfinite(trials.outputs).any(axis=0)).tolist()

    def _posterior(self, trials: Trials, k: int) -> Posterior:
        told = trials.of_output(k)
        if not self._cautious or self.limits[k].watched:
            return self._models[k].posterior(told)
        # Trials that all keep well within the limit show little of what the output may do elsewhere: until they show
        # more, it may differ by as much as the limit is away.
        known = self._known.get(k)
        if known is not None and known[0] == len(told):
            return known[1]
        limit, y = self.limits[k], told.values
        away = min(abs(end - float(y.mean())) for end in (limit.lower, limit.upper) if np.isfinite(end))
        wide = (float(y.mean()) - 2.0 * away, float(y.mean()) + 2.0 * away) if away > 0.0 else None
        posterior = self._model(GaussianProcess(noise=self._noise, output_range=wide), k).posterior(told)
        self._known[k] = (len(told), posterior)
        return posterior

    def _model(self, surrogate: GaussianProcess, k: int) -> ResponseModel:
        return ResponseModel(
            surrogate,
            self._box,
            straying=self._straying,
            lattice=self._lattice,
            continues_chains=False,
            seed=self._seed + 1 + k,
            screened=False,
        )
