"""Profiles of hypothesis: the suite tries the same examples every time; `make explore` looks for new ones."""

import os

from hypothesis import HealthCheck, settings

settings.register_profile("default", derandomize=True, deadline=None, database=None)
settings.register_profile(
    "explore", derandomize=False, deadline=None, max_examples=1000, suppress_health_check=[HealthCheck.too_slow]
)
os.environ["SUREHOLD_WARM_UP"] = "0"  # no child processes but where a test asks for one
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))
