"""Success and failure at the optimizer's door: what is told, what cannot be combined with it, and the answer."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.recommendation import Outcome, Recommendation
from surehold.optimization.surrogates.named import SURROGATES
from surehold.optimization.surrogates.protocol import Posterior
from surehold.optimization.surrogates.success.beta_process import BetaProcess
from surehold.optimization.surrogates.success.model import SuccessProcess

__all__ = [
    "MOST_EXECUTIONS",
    "SUCCESS_SURROGATES",
    "check_combination",
    "counted",
    "described",
    "success_surrogate",
]

#: Names of the surrogates of successes; the first is what None stands for.
SUCCESS_SURROGATES: Final = ("probit", "beta_process")
#: Executions of one trial; more tell nothing more, and could not be counted exactly in their share.
MOST_EXECUTIONS: Final = 1_000_000


def success_surrogate(surrogate: Any) -> SuccessProcess | BetaProcess:
    """Return the surrogate of successes that a setting stands for; raises InputError where it is none."""
    if surrogate is None or surrogate == "probit":
        return SuccessProcess()
    if isinstance(surrogate, (SuccessProcess, BetaProcess)):
        return surrogate
    if surrogate == "beta_process":
        return BetaProcess()
    if isinstance(surrogate, str) and surrogate not in SURROGATES:
        raise unknown_name("surrogate of successes", surrogate, SUCCESS_SURROGATES)
    raise InputError(
        f"surrogate={surrogate!r} cannot be combined with outcome='success', whose model is of probabilities; choose "
        f"one of: {', '.join(SUCCESS_SURROGATES)}."
    )


def check_combination(settings: Mapping[str, Any]) -> None:
    """Raise InputError for settings of `Optimizer`, other than their defaults, that the outcome has no use for."""
    preference = settings["outcome"] == "preference"
    defaults = {
        "direction": "maximize",
        "failures": None,
        **({"surrogate": None, "conditions": "commanded", "constraints": None} if preference else {"criterion": None}),
        "noise": None,
        "output_range": None,
        "risk": "mean",
        "noise_while_exploring": False,
        "trust_region": False,
        "preset": None,
    }
    for name, value in defaults.items():
        given = settings.get(name, value)
        if not (given is value or (isinstance(given, (str, bool)) and given == value)):
            raise InputError(
                f"{name}={given!r} cannot be combined with outcome={settings['outcome']!r}, "
                + ("which has a model" if preference else "which maximizes the probability of success by a criterion")
                + f" of its own; leave {name} out."
            )


def counted(
    outcome: str, y: float | None, success: bool | None, successes: int | None, of: int | None, failed: Any
) -> tuple[float | None, int, Any]:
    """Return value, number of executions and kind of failure of what was told; a value has one execution.

    Raises InputError where values and successes are mixed, or what was told is no outcome.
    """
    told = success is not None or successes is not None or of is not None
    if outcome == "preference" and failed != "rig":
        raise InputError("this optimizer is told preferences: tell_preference(better, worse).")
    if outcome != "success":
        if told:
            raise InputError(
                "this optimizer is told values, tell(x, y); for successes make Optimizer(..., outcome='success')."
            )
        return y, 1, failed
    if y is not None:
        raise InputError(
            f"y is {y!r}, but this optimizer is told successes: tell(x, success=True), or tell(x, successes=7, of=10)."
        )
    if failed == "rig":
        return None, 1, failed
    if failed:
        if told:
            raise InputError("a failed trial has no successes to tell; leave one of the two out.")
        return 0.0, 1, False
    if success is not None:
        if successes is not None or of is not None:
            raise InputError("tell either success=, or successes= and of=, not both.")
        if not isinstance(success, (bool, np.bool_)):
            raise InputError(f"success is {success!r}; give True or False.")
        return float(success), 1, False
    if told and (successes is None or of is None):
        raise InputError(f"successes are {successes} of {of}; tell both, such as successes=7, of=10.")
    if successes is None or of is None:
        raise InputError("nothing was told; say tell(x, success=True), or tell(x, successes=7, of=10).")
    for name, value, least in (("of", of, 1), ("successes", successes, 0)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
            raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    if of > MOST_EXECUTIONS:
        raise InputError(f"of is {of!r}; give at most {MOST_EXECUTIONS} executions a trial.")
    if successes > of:
        raise InputError(f"successes are {successes} of {of}; there cannot be more than executions.")
    return successes / of, int(of), False


def described(
    answer: Recommendation, posterior: Posterior, reached: Perturbations, u: NDArray[np.float64]
) -> Recommendation:
    """Return the recommendation with what is known of the share of executions that succeed at u (d,)."""
    from surehold.optimization.surrogates.success.posterior import shares

    draws = shares(posterior, reached.around(u[None, :])[0], reached.quadrature.weights)
    share = Outcome(draws, np.zeros(len(draws)))
    return replace(answer, expectation=share, quantile=share.quantile(0.05), refused="")
