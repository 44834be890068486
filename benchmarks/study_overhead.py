"""What storing costs: ask and tell through a study, beside the bare optimizer.

    python -m benchmarks.study_overhead [--trials 60] [--postgresql URL] [--many 10000]

The same run (two variables, input noise) by `Optimizer` alone and through a study in memory, a journal, SQLite and
PostgreSQL: milliseconds a trial, and what storing adds, as medians over the trials. Then one ask in a study of many
trials: in a process that has the study open, and with everything read anew.
"""

import argparse
import tempfile
import time
from datetime import datetime
from pathlib import Path
from statistics import median

import numpy as np
from optuna.distributions import distribution_to_json
from optuna.storages._rdb import models
from optuna.trial import TrialState, create_trial
from sqlalchemy import select

import surehold as sh
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

BOX = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
NOISE = sh.InputNoise.unit(0.03)
INITIAL = 10


def value(a: float, b: float) -> float:
    return float(np.sin(9.0 * a) * np.cos(7.0 * b) - (a - 0.4) ** 2)


def bare(trials: int) -> list[float]:
    """Return the seconds of each ask and tell of the optimizer alone."""
    optimizer = sh.Optimizer(BOX, input_noise=NOISE, seed=0, n_initial=INITIAL)
    seconds = []
    for _ in range(trials):
        began = time.perf_counter()
        x = optimizer.ask()
        optimizer.tell(x, value(*x))
        seconds.append(time.perf_counter() - began)
    return seconds


def stored(url: str, trials: int) -> list[float]:
    """Return the same of a study."""
    study = RobotStudy.create("overhead", settings(), url)
    seconds = []
    for _ in range(trials):
        began = time.perf_counter()
        asked = study.ask()
        study.tell(asked.id, value(**asked.parameters))
        seconds.append(time.perf_counter() - began)
    study.close()
    return seconds


def settings() -> StudySettings:
    return StudySettings(SearchSpace(BOX), NOISE, optimizer={"n_initial": INITIAL})


def fill(study: RobotStudy, points: list[list[float]]) -> None:
    """Store finished trials; into a database by its tables, where one after the other would take an hour."""
    space = study.settings.space
    backend = getattr(study.storage.backend, "_backend", None)
    if backend is None:
        study.study.add_trials(
            create_trial(state=TrialState.COMPLETE, params={"a": a, "b": b}, distributions=space.distributions, value=v)
            for a, b, v in ((*x, value(*x)) for x in points)
        )
        return
    identity, now = study.study._study_id, datetime.now()
    form = {name: distribution_to_json(distribution) for name, distribution in space.distributions.items()}
    dated = {"datetime_start": now, "datetime_complete": now, "state": TrialState.COMPLETE, "study_id": identity}
    with backend.engine.begin() as connection:
        tables = models.TrialModel.__table__, models.TrialValueModel.__table__, models.TrialParamModel.__table__
        connection.execute(tables[0].insert(), [{"number": k, **dated} for k in range(len(points))])
        own = tables[0].c.study_id == identity
        ids = list(connection.execute(select(tables[0].c.trial_id).where(own).order_by(tables[0].c.number)).scalars())
        kind = models.TrialValueModel.TrialValueType.FINITE
        told = [{"objective": 0, "value": value(*x), "value_type": kind} for x in points]
        connection.execute(tables[1].insert(), [{"trial_id": i, **row} for i, row in zip(ids, told, strict=True)])
        for k, name in enumerate(form):
            row = {"param_name": name, "distribution_json": form[name]}
            rows = [{"trial_id": i, "param_value": x[k], **row} for i, x in zip(ids, points, strict=True)]
            connection.execute(tables[2].insert(), rows)


def many(url: str, trials: int) -> tuple[list[float], float, float]:
    """Return the seconds of three asks in a study of so many trials, of opening it, and of the ask after that."""
    study = RobotStudy.create("many", settings(), url)
    fill(study, np.random.default_rng(0).random((trials, 2)).tolist())
    asks = []
    for _ in range(3):
        began = time.perf_counter()
        asked = study.ask()
        asks.append(time.perf_counter() - began)
        study.tell(asked.id, value(**asked.parameters))
    study.close()
    began = time.perf_counter()
    again = RobotStudy.open("many", url)
    opened = time.perf_counter() - began if url != "memory" else 0.0
    began = time.perf_counter()
    again.ask()
    cold = time.perf_counter() - began
    again.close()
    return asks, opened, cold


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--many", type=int, default=10_000)
    parser.add_argument("--postgresql", default="", help="URL of an empty database")
    options = parser.parse_args()
    bare(INITIAL + 5)  # compilation
    with tempfile.TemporaryDirectory() as folder:
        places = {"memory": "memory", "journal": f"{folder}/journal.log", "SQLite": f"sqlite:///{folder}/study.db"}
        if options.postgresql:
            places["PostgreSQL"] = options.postgresql
        alone = bare(options.trials)
        print(f"ask + tell, {options.trials} trials, median [ms]\n{'bare optimizer':>16}  {1e3 * median(alone):8.2f}")
        for name, url in places.items():
            found = stored(url, options.trials)
            added = median(f - a for f, a in zip(found, alone, strict=True))
            print(f"{name:>16}  {1e3 * median(found):8.2f}   adds {1e3 * added:7.2f}")
        if options.many:
            print(f"\none ask among {options.many} trials [s]")
            for name, url in places.items():
                if name == "memory":
                    continue
                place = url if "://" in url else str(Path(folder) / "many.log")
                asks, opened, cold = many(place, options.many)
                print(f"{name:>16}  {', '.join(f'{s:.2f}' for s in asks)}; opened anew {opened:.2f} + {cold:.2f}")


if __name__ == "__main__":
    main()
