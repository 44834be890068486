"""Which strategy follows from which settings; what is refused is tested with the optimizer's settings."""

import numpy as np
import pytest

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import CRITERIA
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.strategy.covering import Covering
from surehold.optimization.strategy.expected_improvement import ExpectedImprovement
from surehold.optimization.strategy.named import strategy_named
from surehold.optimization.strategy.risk import RiskAverse
from surehold.optimization.strategy.thesis import ThesisConstants, ThesisImprovement
from surehold.optimization.strategy.thompson import Thompson
from surehold.optimization.strategy.trust_region import TrustRegion

SETTINGS = {"quadrature": None, "k": 1.0, "border": "extend", "kappa": 2.0, "noisy": False}


def named(criterion=None, risk="mean", noise=0.1, trust_region=None, thesis=None, d=2, **settings):
    input_noise = None if noise is None else InputNoise.unit(noise)
    settings = {**SETTINGS, **settings}
    return strategy_named(
        criterion, Risk(risk), Box.unit(d), input_noise, trust_region=trust_region, thesis=thesis, **settings
    )


@pytest.mark.parametrize(
    ("settings", "finer"),
    [
        ({}, True),
        ({"risk": "cvar"}, True),
        ({"risk": "worst"}, False),
        ({"noise": None}, False),
        ({"criterion": "uei"}, False),
        ({"quadrature": "quasi_monte_carlo"}, False),
        ({"risk": "cvar", "quadrature": "unscented"}, False),
    ],
)
def test_more_perturbations_decide_the_answer_where_they_are_ours_to_choose(settings, finer):
    """Of the worst case among the perturbations more of them are another problem."""
    ranking = named(**settings).strategy.ranking
    assert (ranking.finer is not None) == finer
    if finer:
        assert len(ranking.finer.quadrature.weights) > len(ranking.accurate.quadrature.weights)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_every_criterion_has_its_strategy_and_covers_where_it_is_stalled(criterion):
    strategy = named(criterion)
    assert isinstance(strategy, Covering)
    assert isinstance(strategy.strategy, Thompson if "thompson" in criterion else ExpectedImprovement)
    assert strategy.exactly == (criterion in ("ei", "log_ei", "pi", "ucb", "thompson"))


@pytest.mark.parametrize(
    ("noise", "thesis", "scale", "base"),
    [
        (None, None, "exact", "log_ei"),
        (0.1, None, "robust", "log_ei"),
        (None, ThesisConstants(), "exact", "ei"),
        (0.1, ThesisConstants(), "unscented", "ei"),
    ],
)
def test_default_criteria(noise, thesis, scale, base):
    strategy = named(noise=noise, thesis=thesis)
    chosen = strategy.strategy if isinstance(strategy, Covering) else strategy
    assert (chosen.criterion.scale, chosen.criterion.base) == (scale, base)
    assert isinstance(chosen, ExpectedImprovement if thesis is None else ThesisImprovement)
    assert (chosen.repeats, chosen.continues_chains) == ((0, False) if thesis is None else (2, True))
    assert strategy.ranking.screened == (thesis is None)


@pytest.mark.parametrize("criterion", [None, "ei"])
@pytest.mark.parametrize("risk", ["mean-std", "var", "cvar", "worst"])
def test_a_risk_measure_replaces_the_criterion(criterion, risk):
    strategy = named(criterion, risk)
    assert isinstance(strategy, Covering)
    assert isinstance(strategy.strategy, RiskAverse)
    assert not strategy.exactly, "the best trial is the best one by the measure"
    assert len(strategy.ranking.accurate.quadrature.weights) == (32 if risk == "worst" else 64)


def test_a_trust_region_does_not_cover():
    assert isinstance(named("ei", trust_region=TrustRegion(5)), ExpectedImprovement)
    assert isinstance(named(risk="cvar", trust_region=TrustRegion(5)), RiskAverse)


def test_the_quadrature_of_each_form():
    points = {name: len(named(name).ranking.accurate.quadrature.weights) for name in ("uei", "robust_ei")}
    assert points == {"uei": 5, "robust_ei": 64}
    assert [len(named("robust_ei", d=d).ranking.accurate.quadrature.weights) for d in (3, 4)] == [64, 32]
    weights = named("uei", quadrature="unscented", k=0.0).ranking.accurate.quadrature.weights
    np.testing.assert_allclose(weights, [0.0, 0.25, 0.25, 0.25, 0.25])
