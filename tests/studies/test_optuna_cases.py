"""Optuna's own test cases for samplers, run on ours in several settings."""

import optuna
import pytest
from optuna.testing.pytest_samplers import BasicSamplerTestCase, RelativeSamplerTestCase, SingleOnlySamplerTestCase

import surehold as sh

pytestmark = pytest.mark.filterwarnings("ignore")

SETTINGS = {
    "default": lambda: sh.Sampler(seed=0),
    "from the third trial on": lambda: sh.Sampler(seed=1, n_initial=2),
    "treed": lambda: sh.Sampler(seed=2, n_initial=2, surrogate="tgp"),
    "noisy values": lambda: sh.Sampler(seed=3, n_initial=3, noise="inferred", criterion="ucb"),
}


@pytest.fixture(autouse=True, scope="module")
def quiet():
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    yield
    optuna.logging.set_verbosity(before)


class TestSampler(BasicSamplerTestCase, RelativeSamplerTestCase, SingleOnlySamplerTestCase):
    @pytest.fixture(params=SETTINGS)
    def sampler(self, request):
        return SETTINGS[request.param]
