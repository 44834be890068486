"""The model over one or two variables, for pictures: over the whole box, and close to the answer."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import QUASI_RANDOM_EXPONENT_OF_FEW, SCREENING_EXPONENT
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.protocol import Posterior, mixture
from surehold.optimization.variables import Number
from surehold.reports.run_report import Surface

__all__ = ["surfaces_of"]

_LINE, _SQUARE = 301, 81  # grid points along a line, and along each side of a square
_MARGIN: Final = 5.0  # standard deviations of the input noise shown around the candidates in the second view
_CLOSE: Final = 0.7  # share of the box's side from which on a second view shows nothing new


def surfaces_of(
    optimizer: Optimizer,
    noise: InputNoise | None,
    candidates: Sequence[NDArray[np.floating]],
    shown: Sequence[int] | None = None,
) -> tuple[Surface, ...]:
    """Return the model over one or two of the variables that are shown (by default all), in the user's sign.

    Where more than two are shown it is over the two most important ones, a slice through the last candidate, the
    answer: a variable matters as much as the posterior mean varies along it. With input noise a second view shows the
    surroundings of the candidates, where the first is too coarse for them.
    """
    box, posterior = optimizer.box, optimizer.posterior
    center = np.clip(box.to_unit(candidates[-1]), 0.0, 1.0)
    if box.uncontrolled is not None:
        center = box.uncontrolled.at_mean(center)
    among = list(range(box.dimension) if shown is None else shown)
    if not among:
        return ()
    over = sorted(_most_important(posterior, center, among)) if len(among) > 2 else among
    note = ""
    if len(over) < box.dimension:
        note = f"slice through the recommended point over {' and '.join(box.names[k] for k in over)}"
    if len(among) > 2:
        note += ", the two that matter most"
    whole = np.array([[0.0, 1.0]] * len(over))
    views = [(whole, note)]
    if noise is not None:
        close = _around(box, noise, candidates, over)
        narrower = close[:, 1] - close[:, 0] < _CLOSE
        stepped = [box.names[k] in _stepped(box) for k in over]  # of few levels all are seen in both views
        if narrower.any() and np.all(narrower | stepped):
            views.append((close, f"{note}{', ' * bool(note)}close to the answer"))
    sign = -1.0 if optimizer.direction == "minimize" else 1.0
    return tuple(
        replace(
            _surface(posterior, box, noise, center, tuple(over), limits, text, sign),
            variables=tuple(among.index(k) for k in over),
        )
        for limits, text in views
    )


def _around(
    box: Box, noise: InputNoise, candidates: Sequence[NDArray[np.floating]], over: Sequence[int]
) -> NDArray[np.float64]:
    """Return limits (v, 2) in the unit cube that hold the candidates and where they may end up, within the cube.

    Of a variable with steps they hold the levels beside the candidates: between two levels there is nothing to see.
    """
    limits = []
    for x in candidates:
        deviations = np.sqrt(np.diag(noise.unit_covariance(box, x)))[over]
        u = np.clip(box.to_unit(x), 0.0, 1.0)[over]
        margin = np.maximum(_MARGIN * deviations, 0.02)
        levels = np.array([_levels_beside(box, k, float(x[k])) for k in over])
        limits.append((np.minimum(u - margin, levels[:, 0]), np.maximum(u + margin, levels[:, 1])))
    lower = np.min([low for low, _ in limits], axis=0)
    upper = np.max([high for _, high in limits], axis=0)
    return np.clip(np.stack([lower, upper], axis=1), 0.0, 1.0)


def _stepped(box: Box) -> dict[str, Number]:
    return {variable.name: variable for variable in box.variables if isinstance(variable, Number) and variable.step}


def _levels_beside(box: Box, k: int, coordinate: float) -> NDArray[np.float64]:
    """Return the levels (2,) below and above one along axis k of the unit cube; where there are no steps, it twice."""
    beside = np.full(2, coordinate)
    if (variable := _stepped(box).get(box.names[k])) is not None:
        steps = variable.to_value(beside) + variable.step * np.array([-1.0, 1.0])
        low, high = np.exp(variable.bounds()) if variable.log else variable.bounds()
        beside = variable.to_coordinate(np.clip(steps, low, high))
    return (beside - box.lower[k]) / box.widths[k]


def _surface(
    posterior: Posterior,
    box: Box,
    noise: InputNoise | None,
    center: NDArray[np.float64],
    variables: tuple[int, ...],
    limits: NDArray[np.float64],
    note: str,
    sign: float,
) -> Surface:
    points = _LINE if len(variables) == 1 else _SQUARE
    lines = [np.linspace(low, high, points) for low, high in limits]
    shape = (points,) * len(variables)
    queries = np.tile(center, (points ** len(variables), 1))
    for k, grid in zip(variables, np.meshgrid(*lines, indexing="ij"), strict=True):
        queries[:, k] = grid.ravel()
    mean, variance = mixture(posterior.moments(queries))
    robust_mean = robust_std = None
    if noise is not None:
        # sigma points, three along a line, draw hills and dips beside a peak that the average does not have
        exponent = QUASI_RANDOM_EXPONENT_OF_FEW if len(variables) == 1 else SCREENING_EXPONENT
        perturbations = Perturbations.of(noise, box, "quasi_monte_carlo", exponent=exponent)
        averaged, spread = mixture(perturbations.outcome(posterior, queries))
        robust_mean, robust_std = sign * averaged.reshape(shape), np.sqrt(spread).reshape(shape)
    axes = tuple(box.lower[k] + line * box.widths[k] for k, line in zip(variables, lines, strict=True))
    return Surface(
        variables, axes, sign * mean.reshape(shape), robust_mean, np.sqrt(variance).reshape(shape), robust_std, note
    )


def _most_important(posterior: Posterior, center: NDArray[np.float64], among: Sequence[int]) -> list[int]:
    line = np.linspace(0.0, 1.0, 41)
    variation = []
    for k in among:
        queries = np.tile(center, (line.size, 1))
        queries[:, k] = line
        variation.append(float(np.var(mixture(posterior.moments(queries))[0])))
    order = np.argsort(-np.array(variation), kind="stable")
    return [among[i] for i in order[:2]]
