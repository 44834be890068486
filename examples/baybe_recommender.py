"""A recommender for BayBE (tested with 0.15): `python examples/baybe_recommender.py`.

BayBE hands over all measurements at every call; the optimizer is rebuilt from them, which is all that `ask` depends on.
Needs baybe and surehold; continuous parameters and one numerical target.
"""

from typing import Any

import numpy as np
import pandas as pd

import surehold as sh


class RobustRecommender:
    """Recommends experiments after which `answer` knows what still holds when the setting is off.

    Parameters
    ----------
    input_noise, settings
        As in `surehold.Optimizer`.
    """

    def __init__(self, input_noise: sh.InputNoise, **settings: Any):
        self.input_noise, self.settings = input_noise, settings

    def recommend(
        self,
        batch_size: int,
        searchspace: Any,
        objective: Any = None,
        measurements: pd.DataFrame | None = None,
        pending_experiments: pd.DataFrame | None = None,
    ) -> pd.DataFrame:
        """Return the next experiments, one a row; see `baybe.recommenders.base.RecommenderProtocol`."""
        optimizer = self.optimizer(searchspace, objective, measurements, pending_experiments)
        return pd.DataFrame(optimizer.ask(batch_size), columns=list(optimizer.box.names))

    def answer(self, searchspace: Any, objective: Any, measurements: pd.DataFrame) -> sh.Recommendation:
        """Return the setting that holds."""
        return self.optimizer(searchspace, objective, measurements).recommend()

    def optimizer(
        self, searchspace: Any, objective: Any, measurements: pd.DataFrame | None, pending: pd.DataFrame | None = None
    ) -> sh.Optimizer:
        """Return an optimizer that was told the measurements."""
        box = sh.Box({p.name: (p.bounds.lower, p.bounds.upper) for p in searchspace.continuous.parameters})
        (target,) = objective.targets
        optimizer = sh.Optimizer(
            box,
            direction="minimize" if target.minimize else "maximize",
            input_noise=self.input_noise,
            **self.settings,
        )
        if measurements is not None and len(measurements):
            waiting = None if pending is None else pending[list(box.names)].to_numpy(float)
            told = measurements[[*box.names, target.name]].to_numpy(float)
            optimizer.restore(told[:, :-1], told[:, -1], pending=waiting)
        return optimizer


def campaign(n: int) -> tuple[sh.Recommendation, np.ndarray]:
    """Run n experiments of BayBE's own loop; return what holds, and the highest that was measured."""
    from baybe import Campaign
    from baybe.parameters import NumericalContinuousParameter
    from baybe.searchspace import SearchSpace
    from baybe.targets import NumericalTarget

    f = sh.problems.GM()
    limits = zip(f.box.names, f.box.lower, f.box.upper, strict=True)
    space = SearchSpace.from_product([NumericalContinuousParameter(name, (a, b)) for name, a, b in limits])
    recommender = RobustRecommender(sh.InputNoise.unit(0.1), seed=2)
    campaign = Campaign(space, NumericalTarget("value").to_objective(), recommender)
    for _ in range(n):
        batch = campaign.recommend(1)
        batch["value"] = f(batch[list(f.box.names)].to_numpy())
        campaign.add_measurements(batch)
    measured = campaign.measurements
    highest = measured.loc[measured["value"].idxmax(), list(f.box.names)].to_numpy(float)
    return recommender.answer(space, campaign.objective, measured), highest


if __name__ == "__main__":
    answer, highest = campaign(50)
    print("highest measured:", highest)
    print("holds when the setting is off:", answer.x)
