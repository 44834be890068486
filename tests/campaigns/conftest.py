import pytest

from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup

CHEAP = """
title: A cheap plan
runs: 4
problems:
  hill: {function: rkhs, trials: 8, initial: 5, input_noise: 0.01, requeries: 20}
  flat: {function: gf, trials: 8, initial: 6, input_noise: 0.05, requeries: 20}
methods:
  BO: {surrogate: gp}
  UBO: {surrogate: gp, robust: true}
"""


@pytest.fixture(scope="session")
def cheap_text():
    return CHEAP


@pytest.fixture(scope="session")
def cheap():
    problems = {
        "hill": ProblemSetup("rkhs", 8, 5, input_noise=0.01, requeries=20),
        "flat": ProblemSetup("gf", 8, 6, input_noise=0.05, requeries=20),
    }
    methods = {
        "BO": MethodSetup(settings={"surrogate": "gp"}),
        "UBO": MethodSetup(robust=True, settings={"surrogate": "gp"}),
    }
    return Plan("cheap", "A cheap plan", problems, methods, runs=4)
