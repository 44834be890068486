"""The strategy that follows from an optimizer's settings."""

import numpy as np

from surehold.defaults import (
    CORRECTION_EXPONENT,
    CORRECTION_EXPONENT_OF_FEW,
    FEW_VARIABLES,
    OUTCOME_EXPONENT,
    QUASI_RANDOM_EXPONENT,
    QUASI_RANDOM_EXPONENT_OF_FEW,
    SCREENING_EXPONENT,
)
from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import criterion_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Allowed, Perturbations
from surehold.optimization.strategy.covering import Covering
from surehold.optimization.strategy.expected_improvement import ExpectedImprovement
from surehold.optimization.strategy.protocol import Strategy
from surehold.optimization.strategy.ranking import Ranking
from surehold.optimization.strategy.risk import RiskAverse
from surehold.optimization.strategy.success import SuccessImprovement
from surehold.optimization.strategy.thesis import ThesisConstants, ThesisImprovement
from surehold.optimization.strategy.thompson import Thompson
from surehold.optimization.strategy.trust_region import TrustRegion

__all__ = ["strategy_named"]


def strategy_named(
    criterion: str | None,
    risk: Risk,
    box: Box,
    input_noise: InputNoise | None,
    *,
    quadrature: str | None,
    k: float,
    border: str,
    kappa: float,
    noisy: bool,
    trust_region: TrustRegion | None,
    thesis: ThesisConstants | None,
    allowed: Allowed | None = None,
    outcome: str = "value",
    counted: bool = False,
) -> Strategy:
    """Return the strategy of these settings, as of `Optimizer`; `noisy`: whether observations carry noise.

    `counted`: whether the surrogate of successes is the beta process.

    Raises
    ------
    InputError
        For an unknown name, a value out of range, or settings that contradict each other.
    """
    shaken = input_noise is not None or box.uncontrolled is not None
    if criterion is None:
        criterion = ("log_ei", "robust_log_ei", "ei", "uei")[2 * (thesis is not None) + shaken]
    name = criterion_name(criterion)
    if not np.isfinite(kappa):
        raise InputError(f"kappa is {kappa!r}; give a finite number of standard deviations.")
    averse = risk.name != "mean"
    if box.uncontrolled is not None and (thesis is not None or (name.scale == "exact" and not averse)):
        raise InputError(
            "some variables are uncontrolled: what counts is the outcome over them, so that a criterion of it is "
            "needed, such as 'robust_log_ei' (the default), and no thesis preset."
        )
    if not shaken and (name.scale != "exact" or averse):
        what = f"risk '{risk.name}'" if averse else f"criterion '{criterion}'"
        raise InputError(f"{what} needs input noise; give input_noise=.")
    default = "quasi_monte_carlo" if name.scale == "robust" or averse else "unscented"
    rule = default if quadrature is None else quadrature
    few = box.dimension <= FEW_VARIABLES and risk.name != "worst"  # of more perturbations another one is the worst
    exponent = QUASI_RANDOM_EXPONENT_OF_FEW if few else QUASI_RANDOM_EXPONENT
    accurate = Perturbations.of(input_noise, box, rule, border, k=k, exponent=exponent, allowed=allowed)
    risk.check_weights(accurate.quadrature.weights, rule)
    coarse = Perturbations.of(input_noise, box, "unscented", border, allowed=allowed)
    screening = finer = None
    if rule == "quasi_monte_carlo" and shaken:
        screening = Perturbations.of(input_noise, box, rule, border, exponent=SCREENING_EXPONENT, allowed=allowed)
    if quadrature is None and rule == "quasi_monte_carlo" and risk.name != "worst" and shaken:
        exponent = (CORRECTION_EXPONENT_OF_FEW if few else CORRECTION_EXPONENT) if averse else OUTCOME_EXPONENT
        finer = Perturbations.of(input_noise, box, rule, border, exponent=exponent, allowed=allowed)
    ranking = Ranking(accurate, coarse, risk, noisy, thesis is None, finer, screening)
    if thesis is not None:
        for setting, given in (
            (f"risk='{risk.name}'", averse),
            (f"criterion='{criterion}'", name.base == "thompson"),
            ("trust_region=True", trust_region is not None),
        ):
            if given:
                raise InputError(
                    f"{setting} chooses trials in another way than the thesis does; leave it out, or the preset."
                )
        return ThesisImprovement(ranking, name, thesis.margin, float(kappa))
    if outcome == "success":
        return Covering(SuccessImprovement(ranking, counted), exactly=input_noise is None)
    exactly = name.scale == "exact" and not averse
    strategy: Strategy
    if averse:
        strategy = RiskAverse(ranking, float(kappa), trust_region)
    elif name.base == "thompson":
        if trust_region is not None:
            raise InputError(f"criterion '{criterion}' knows no trust region; leave one of them out.")
        strategy = Thompson(ranking, exactly)
    else:
        strategy = ExpectedImprovement(ranking, name, float(kappa), trust_region)
    return strategy if trust_region is not None else Covering(strategy, exactly)
