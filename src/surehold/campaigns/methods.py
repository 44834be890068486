"""Methods of a campaign behind one interface: our optimizer by its settings, and other libraries'.

All work on the unit cube, maximize, and get the same initial design.
"""

from collections.abc import Mapping
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.embedded import EMBEDDED
from surehold.campaigns.peers import PEERS, REQUIRES, installed_peers
from surehold.campaigns.plan import Cell
from surehold.campaigns.problem_setup import robust_problem_of, unit_noise_of
from surehold.errors import InputError, unknown_name
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, root_of
from surehold.optimization.noise.samples import Samples
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.strategy.thesis import thesis_preset
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.named import SURROGATES
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess, least_leaf_width

__all__ = ["METHODS", "Method", "build_method", "checked_method", "checked_settings", "perturbations_of"]

#: Optimizers that a plan may name.
METHODS: Final = ("surehold", *EMBEDDED, *PEERS)
_ROBUST: Final = ("surehold", "botorch")  # those that can be told of the input noise
_TREE: Final = ("min_leaf", "weight_power", "trees")
_PROCESS: Final = ("noise", "output_range")
_SETTINGS: Final = (
    *("preset", "surrogate", "criterion", *_TREE, *_PROCESS),
    *("risk", "alpha", "beta", "quadrature", "k", "border", "kappa", "trust_region"),
)


class Method(Protocol):
    """What a campaign runs."""

    def ask(self) -> NDArray[np.float64]:
        """Return the next trial (d,) in the unit cube."""
        ...

    def tell(self, u: NDArray[np.float64], y: float) -> None:
        """Record the outcome of a trial; NaN for one that failed."""
        ...

    def answer(self) -> NDArray[np.float64]:
        """Return the input (d,) that the method would return now."""
        ...


class Surehold:
    """Our optimizer by the settings of a plan."""

    def __init__(
        self,
        dimension: int,
        initial: NDArray[np.float64],
        seed: int,
        input_noise: InputNoise | None,
        settings: Mapping[str, Any],
    ):
        own = dict(settings)
        box = Box.unit(dimension)
        if own.get("surrogate") == "tgp":
            own["surrogate"] = _treed(own, box, input_noise, seed)
        options = {name: own.pop(name) for name in ("alpha", "beta") if name in own}
        if "risk" in own:
            own["risk"] = Risk(own["risk"], **options)
        elif options:
            name, value = next(iter(options.items()))
            raise InputError(f"{name} is {value!r}, but no risk is given; name the measure, such as risk: cvar.")
        self._optimizer = Optimizer(box, input_noise=input_noise, n_initial=len(initial), seed=seed, **own)
        self._waiting = list(initial)

    def ask(self) -> NDArray[np.float64]:
        """Return the next trial."""
        return self._waiting.pop(0) if self._waiting else self._optimizer.ask()

    def tell(self, u: NDArray[np.float64], y: float) -> None:
        """Record a trial."""
        if np.isfinite(y):
            self._optimizer.tell(u, y)
        else:
            self._optimizer.tell(u, failed=True)

    def answer(self) -> NDArray[np.float64]:
        """Return the recommended input; without input noise the highest observed, as the thesis reports it."""
        if self._optimizer.input_noise is None:
            return self._optimizer.X[int(np.nanargmax(self._optimizer.y))]
        return self._optimizer.recommend().x

    @property
    def leaves(self) -> int:
        """Leaves of the tree; 1 of a surrogate without one."""
        partition = self._optimizer.posterior.diagnostics.partition
        return 1 if partition is None else partition.leaves


def build_method(cell: Cell, dimension: int, initial: NDArray[np.float64], seed: int) -> Method:
    """Return the method of a cell, about to start.

    Raises
    ------
    InputError
        If a setting has no valid value, or a library is not installed.
    """
    told = cell.as_data()
    noise = unit_noise_of(cell.on) if cell.by.robust else None
    asked = robust_problem_of(cell.on) if cell.by.robust else None
    clips = asked is not None and getattr(asked.function, "clips", False)
    if cell.by.optimizer == "surehold":
        stated = {"border": "clip"} if clips else {}
        own = told["settings"].get("risk")
        if asked is not None and asked.risk != "mean" and own in (None, asked.risk):  # parameters are of the measure
            stated |= {name: getattr(asked, name) for name in ("risk", "alpha", "beta")}
        return Surehold(dimension, initial, seed, noise, {**stated, **told["settings"]})
    if cell.by.optimizer in EMBEDDED:
        return EMBEDDED[cell.by.optimizer](dimension, initial, seed)
    if cell.by.optimizer not in installed_peers():
        missing = ", ".join(REQUIRES[cell.by.optimizer])
        raise InputError(f"method '{cell.method}' needs {missing}; install them: pip install 'surehold[peers]'.")
    extra = {} if noise is None else {"perturbations": perturbations_of(noise, dimension, seed), "clips": clips}
    return PEERS[cell.by.optimizer](dimension, initial, seed, **extra)


def checked_method(cell: Cell) -> None:
    """Check the values of a cell's settings, and that its library is installed, before anything is run.

    Raises
    ------
    InputError
        That names the method.
    """
    asked = robust_problem_of(cell.on)
    d = 2 if asked is None else asked.function.box.dimension
    try:
        build_method(cell, d, np.full((1, d), 0.5), 0)
    except InputError as error:
        text = str(error)
        raise InputError(text if cell.method in text else f"method '{cell.method}': {text}") from None


def checked_settings(where: str, optimizer: str, settings: Mapping[str, Any], robust: bool) -> None:
    """Check the names of settings, and that the optimizer can be told of the input noise where it shall be.

    Raises
    ------
    InputError
        With the nearest valid name.
    """
    valid = _SETTINGS if optimizer == "surehold" else ()
    for name, value in settings.items():
        if not valid:
            raise InputError(f"{where} sets {name!r}, but '{optimizer}' runs with its own defaults; leave it out.")
        if name not in valid:
            raise unknown_name(f"setting of {where}", name, (*valid, "optimizer", "robust"))
        if name == "preset" and value is not None:
            thesis_preset(value)
        if name == "surrogate" and value not in SURROGATES:
            raise unknown_name(f"surrogate of {where}", value, SURROGATES)
    if robust and optimizer not in _ROBUST:
        raise InputError(f"{where}: '{optimizer}' cannot be told of input noise; leave `robust` out.")


def perturbations_of(noise: InputNoise, dimension: int, seed: int) -> NDArray[np.float64]:
    """Return 16 quasi-random perturbations (s, d) of noise of the unit cube; where it is samples, these.

    Raises
    ------
    InputError
        If the noise is not the same everywhere.
    """
    if noise.varies:
        raise InputError(f"BoTorch is told of input noise that is the same everywhere, not {noise!r}.")
    if isinstance(noise.kind, Samples):
        return noise.kind.errors
    from scipy.special import ndtr
    from scipy.stats import qmc

    normals = qmc.MultivariateNormalQMC(np.zeros(dimension), rng=np.random.default_rng(seed)).random(16)
    standard = 3.0**0.5 * (2.0 * ndtr(normals) - 1.0) if noise.bounded else normals
    return standard @ root_of(noise.unit_covariance(Box.unit(dimension))).T


def _treed(own: dict[str, Any], box: Box, input_noise: InputNoise | None, seed: int) -> TreedGaussianProcess:
    """Return the tree of a plan's settings, which are taken out of `own`."""
    deviations = np.zeros(box.dimension)
    if input_noise is not None:
        deviations = np.sqrt(np.diag(input_noise.unit_covariance(box)))
    tree = {name: own.pop(name) for name in _TREE if name in own}
    if "weight_power" in tree:
        tree["weight_power"] = float(tree["weight_power"])
    if own.get("preset") is not None:
        return thesis_preset(own["preset"]).tree(deviations, seed, **tree)
    process = {name: own.pop(name) for name in _PROCESS if own.get(name) is not None}
    margin = least_leaf_width(deviations)
    return TreedGaussianProcess(process=GaussianProcess(**process), margin=margin, seed=seed, **tree)
