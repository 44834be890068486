"""The kernels that an optimizer's settings need, compiled in a child process while the initial design is tried.

The child makes a short run with the same settings; what decides nothing about the kernels is left out of them, so that
one run serves many optimizers.
"""

import json
import pickle
import sys
from collections.abc import Mapping
from hashlib import sha256
from inspect import signature
from typing import Any, Final

import numpy as np

from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.surrogates.gaussian_process.likelihood import log_posterior
from surehold.optimization.surrogates.gaussian_process.neighbors import NeighborPosterior
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.store import background

__all__ = ["compile_ahead", "compile_now", "essentials"]

_CODE: Final = "from surehold.optimization.compilation import main; main()"
_DECISIVE: Final = ("surrogate", "criterion", "risk", "noise_while_exploring", "trust_region", "preset", "outcome")
_DESIGN: Final = 4
_TRIALS: Final = 7


def essentials(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return what decides the kernels of an optimizer with these arguments."""
    found = {name: settings[name] for name in _DECISIVE if settings.get(name) is not None}
    noise = settings.get("noise")
    if noise is not None:
        found["noise"] = noise if isinstance(noise, str) else 0.1
    strays: InputNoise | None = settings.get("input_noise")
    found["input_noise"] = "" if strays is None else "varying" if strays.varies else "constant"
    return found


def compile_ahead(settings: Mapping[str, Any]) -> None:
    """Start compiling the kernels of an optimizer with these arguments, unless the cache holds them.

    Not for a surrogate from elsewhere: a child process cannot know it.
    """
    surrogate = settings.get("surrogate")
    if not isinstance(surrogate, str | None) and not type(surrogate).__module__.startswith("surehold."):
        return
    told = essentials(settings)
    try:
        key = _key(told)
        background.begin(background.marker_of(log_posterior, key), _CODE, pickle.dumps((key, told)))
    except (pickle.PicklingError, AttributeError, TypeError):
        return  # an object within an object; its kernels are compiled when they are called


def compile_now(settings: Mapping[str, Any]) -> None:
    """Make a short run with these arguments, at whose end the cache holds the kernels, and note that in the cache.

    What they leave open has the default of `Optimizer`: what is noted is what an optimizer will look for.
    """
    from surehold.optimization.optimizer import Optimizer

    told = essentials({name: one.default for name, one in signature(Optimizer).parameters.items()} | dict(settings))
    _compile(_key(told), told)


def main() -> None:
    """Compile what the standard input names; the child's whole work."""
    _compile(*pickle.loads(sys.stdin.buffer.read()))


def _key(told: Mapping[str, Any]) -> bytes:
    return json.dumps(told, sort_keys=True, default=lambda value: sha256(pickle.dumps(value)).hexdigest()).encode()


def _compile(key: bytes, told: Mapping[str, Any]) -> None:
    marker = background.marker_of(log_posterior, key)
    if marker is None:  # each process compiles anew
        return
    with background.marking(marker) as wanted:
        if wanted:
            _short_run(told)


def _short_run(told: Mapping[str, Any]) -> None:
    from surehold.optimization.box import Box
    from surehold.optimization.optimizer import Optimizer

    kinds = {
        "": None,
        "constant": InputNoise.unit(0.05),
        "varying": InputNoise.varying(lambda x: [0.05] * len(x)),
    }
    settings = {**told, "input_noise": kinds[told["input_noise"]]}
    optimizer = Optimizer(Box.unit(2), n_initial=_DESIGN, **settings)
    best = None
    for _ in range(_TRIALS):
        x = optimizer.ask()
        if optimizer.outcome == "preference":
            if best is not None:
                optimizer.tell_preference(x, best)
            best = x
            continue
        value = float(1.0 - (x[0] - 0.3) ** 2 - abs(x[1] - 0.6))
        if optimizer.outcome == "success":
            optimizer.tell(x, success=value > 0.6)
        else:
            optimizer.tell(x, value)
    optimizer.ask(2)
    optimizer.recommend()
    optimizer.promise()
    few = optimizer.posterior
    if isinstance(few, GaussianProcessPosterior):  # what becomes of it when there are many trials
        many = NeighborPosterior(few.evidence, few.hyperparameters.theta, few.outputs, 0)
        many.moments(optimizer.X, gradient=True)
        if told["input_noise"]:  # points farther away than any trial
            many.average(optimizer.X, 2.0 * np.eye(2), np.full(2, 0.5), gradient=True)
