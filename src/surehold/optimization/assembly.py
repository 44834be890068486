"""What an optimizer is made of, from its settings; their combinations are checked here."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    DESIGN_LEAST,
    DESIGN_MOST,
    DESIGN_PER_VARIABLE,
    DESIGN_VARIABLES_PER_MORE,
    FAILURES_MODELLED,
)
from surehold.errors import InputError, unknown_name
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.argument_kinds import check_kinds
from surehold.optimization.box import Box
from surehold.optimization.constraints.input import Region, region_of
from surehold.optimization.known_coordinates import places_of
from surehold.optimization.lattice import Lattice, lattice_of
from surehold.optimization.limits import Limit, limits_of
from surehold.optimization.noise.input_noise import InputNoise, noise_of_coordinates
from surehold.optimization.requirements import Requirements
from surehold.optimization.response_model import ResponseModel, chosen_surrogate
from surehold.optimization.strategy.initial_design import design as initial_design
from surehold.optimization.strategy.initial_design import drawn_to
from surehold.optimization.strategy.named import strategy_named
from surehold.optimization.strategy.protocol import Strategy
from surehold.optimization.strategy.thesis import thesis_preset
from surehold.optimization.strategy.trust_region import TrustRegion
from surehold.optimization.success import SUCCESS_SURROGATES, check_combination, success_surrogate
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.named import TELLABLE
from surehold.optimization.surrogates.protocol import NoisySurrogate
from surehold.optimization.surrogates.success.beta_process import BetaProcess
from surehold.optimization.surrogates.success.preference import PreferenceProcess
from surehold.optimization.trial_inputs import check_tried, initial_inputs

__all__ = ["Parts", "assembled", "default_n_initial", "whole_number"]


@dataclass(frozen=True)
class Parts:
    """What an optimizer is made of."""

    settings: Mapping[str, Any]
    """as they are stored"""
    input_noise: InputNoise | None
    """over the coordinates of the cube"""
    seed: int
    n_initial: int
    lattice: Lattice | None
    limits: tuple[Limit, ...]
    model: ResponseModel
    strategy: Strategy
    requirements: Requirements | None
    design: NDArray[np.float64]
    """(n_initial, d) of the unit cube"""


def default_n_initial(box: Box, variables: int | None = None) -> int:
    """Return the size of the initial design where none is given: 5 for each variable, at least 6, at most 20 + d/5.

    `variables` are those that can vary, where the box has others.
    """
    d = len(box.variables) if variables is None else variables
    return max(DESIGN_LEAST, min(DESIGN_PER_VARIABLE * d, DESIGN_MOST + d // DESIGN_VARIABLES_PER_MORE))


def whole_number(name: str, value: int, least: int, most: float = np.inf) -> int:
    """Return the argument `name` as an int; raises InputError where it is none from `least` to `most`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    if value > most:
        raise InputError(f"{name} is {value}; give {most:,} at most.")
    return int(value)


def assembled(box: Box, settings: Mapping[str, Any]) -> Parts:
    """Return the parts of an `Optimizer` of these settings, all of its arguments but the box.

    Raises InputError for unknown names, values out of range and settings that contradict each other.
    """
    if not isinstance(box, Box):
        raise InputError(f"box is {box!r}; give a surehold.Box of named bounds.")
    check_kinds(settings)
    s = SimpleNamespace(**settings)
    _check(s, box.dimension)
    if s.outcome != "value":
        check_combination(settings)
    elif isinstance(s.surrogate, str) and s.surrogate in SUCCESS_SURROGATES:
        raise InputError(f"surrogate='{s.surrogate}' is of successes; say outcome='success' beside it.")
    seed = whole_number("seed", s.seed, 0)
    input_noise = noise_of_coordinates(s.input_noise, box)
    straying = input_noise if s.noise_while_exploring else None
    first = initial_inputs(box, s.initial_points)
    wanted = default_n_initial(box, len(box.variables) - len(s.fixed or ())) if s.n_initial is None else s.n_initial
    wanted = whole_number("n_initial", wanted, 1)
    n_initial = len(first) if s.safety is not None else max(wanted, len(first))
    told = s.noise == "told"
    thesis = None if s.preset is None else thesis_preset(s.preset)
    own = {"success": lambda: success_surrogate(s.surrogate), "preference": PreferenceProcess}
    surrogate = chosen_surrogate(
        own.get(s.outcome, lambda: s.surrogate)(),
        preset=s.preset,
        thesis=thesis,
        noise=None if told else s.noise,
        output_range=_turned(s.output_range) if s.direction == "minimize" else s.output_range,
        box=box,
        input_noise=input_noise,
        seed=seed,
    )
    if input_noise is not None:
        input_noise.warn_if_larger_than(box)
    lattice = lattice_of(box, s.fixed)
    if lattice is not None:
        check_tried(box, first, lattice.snap(first))
    region = region_of(box, s.allowed, lattice, seed, first)
    strategy = strategy_named(
        s.criterion,
        Risk(s.risk) if isinstance(s.risk, str) else s.risk,
        box,
        input_noise,
        quadrature=s.quadrature,
        k=s.k,
        border=s.border,
        kappa=s.kappa,
        noisy=getattr(surrogate, "noisy", False) or s.noise_while_exploring or told,
        trust_region=TrustRegion(n_initial) if s.trust_region else None,
        thesis=thesis,
        allowed=None if region is None else region.contains,
        outcome=s.outcome,
        counted=isinstance(surrogate, BetaProcess),
    )
    takes_noise = isinstance(surrogate, NoisySurrogate)
    if s.noise_while_exploring and (input_noise is None or thesis is not None or not takes_noise):
        raise InputError(
            "noise_while_exploring needs input_noise= and a surrogate that takes the noise of single trials "
            "('two_scales', 'gp', 'tgp', or an object with known_noise), without a thesis preset."
        )
    limits = limits_of(s.constraints)
    exact = thesis is None and strategy.ranking.exact_inputs and not strategy.ranking.noisy
    model = ResponseModel(
        surrogate,
        box,
        straying=straying,
        lattice=lattice,
        continues_chains=strategy.continues_chains,
        seed=seed,
        told=told,
        compressed=exact and isinstance(surrogate, GaussianProcess) and all(limit.watched for limit in limits),
    )
    for limit in limits:
        if limit.name in box.names:
            raise InputError(
                f"constraint '{limit.name}' is named as a variable of the box: limits of what may be tried are "
                f"allowed='{limit.name} <= 3' (--allowed), constraints are of further outputs."
            )
    requirements = None
    if _required(s, region, limits, first):
        requirements = Requirements(
            box,
            region,
            limits,
            level=s.feasible,
            safety=s.safety,
            ranking=strategy.ranking,
            straying=straying,
            noise="inferred" if strategy.ranking.noisy and straying is None else "none",
            lattice=lattice,
            seed=seed,
            failures=_failures_modelled(s),
        )
    rng = np.random.default_rng([seed, 0])
    rest = initial_design(s.design, max(n_initial - len(first), 1), box.dimension, rng)
    if s.guess:
        within = {} if region is None else {"allowed": region.contains, "pool": region.points}
        rest = drawn_to(_guess(s, box), rest, before=first, snap=partial(_commanded, box, lattice), **within)
    if requirements is not None:
        rest = requirements.initial(rest, first, rng)
    if lattice is not None and thesis is None and not strategy.ranking.noisy:
        rest = lattice.distinct(rest, first, rng, None if region is None else region.contains)
    stored = {
        "initial_points": None if s.initial_points is None else box.from_unit(first).tolist(),
        "constraints": None if s.constraints is None else {limit.name: limit.stated for limit in limits},
    }
    return Parts(
        settings={**settings, **stored},
        input_noise=input_noise,
        seed=seed,
        n_initial=n_initial,
        lattice=lattice,
        limits=limits,
        model=model,
        strategy=strategy,
        requirements=requirements,
        design=np.concatenate([first, rest]),
    )


def _turned(output_range: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if output_range is None else (-output_range[1], -output_range[0])


def _check(s: SimpleNamespace, d: int) -> None:
    for name, known in (
        ("direction", ("maximize", "minimize")),
        ("outcome", ("value", "success", "preference")),
        ("conditions", ("commanded", "measured")),
        ("failures", (None, "lowest", "modelled")),
    ):
        if getattr(s, name) not in known:
            shown = "rule for failures" if name == "failures" else name
            raise unknown_name(shown, getattr(s, name), [choice for choice in known if choice is not None])
    if s.noise == "told" and s.outcome == "value" and (s.preset is not None or s.surrogate not in (None, *TELLABLE)):
        raise InputError(f"noise='told' needs one of the surrogates {', '.join(TELLABLE)}, and no preset.")
    for name in ("feasible", "safety"):
        value = getattr(s, name)
        if value is not None and not 0 < value < 1:
            raise InputError(f"{name} is {value!r}; give a probability strictly between 0 and 1, such as 0.95.")
    if not (np.isfinite(s.k) and d + s.k > 0.0):  # also where another rule than "unscented" leaves it unused
        raise InputError(f"k is {s.k!r}; with {d} coordinates it must be a finite number above {-d}.")
    if s.kappa < 0.0:
        raise InputError(f"kappa is {s.kappa!r}; give standard deviations to be added, 0 or more.")


def _commanded(box: Box, lattice: Lattice | None, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is equal, of points u (d,) of the cube, where the same is commanded."""
    u = u if lattice is None else lattice.snap(u)
    return u if box.uncontrolled is None else box.uncontrolled.at_mean(u)


def _guess(s: SimpleNamespace, box: Box) -> NDArray[np.float64]:
    """Return where the guess is in the unit cube, (d,), nan where none is made."""
    if s.safety is not None:
        raise InputError("guess is of the initial design, of which there is none with safety=; leave one of them out.")
    for name in s.guess:
        if name in (s.fixed or ()):
            raise InputError(f"'{name}' has a fixed value and a guess; take it out of one of the two.")
    return places_of(box, "guess", s.guess)


def _failures_modelled(s: SimpleNamespace) -> float:
    """Return up to how many trials it is modelled which of them fail."""
    if s.failures is None:
        return 0 if s.preset is not None or s.outcome != "value" else FAILURES_MODELLED
    return np.inf if s.failures == "modelled" else 0


def _required(s: SimpleNamespace, region: Region | None, limits: tuple[Limit, ...], first: NDArray[np.float64]) -> bool:
    """Tell whether these settings require anything of trials and answers."""
    if s.safety is not None and (all(limit.watched for limit in limits) or not len(first)):
        raise InputError(
            "safety= needs constraints= with a limit, and initial_points= (--first) that are known to keep all limits."
        )
    if region is None and not limits and not _failures_modelled(s):
        return False
    if s.preset is not None:
        raise InputError(
            f"preset='{s.preset}' chooses trials as the thesis does, which knows no constraints; leave one out."
        )
    return True
