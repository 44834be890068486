"""
A study with workers
====================

Three robots ask and tell one stored study. Nobody waits for another; each keeps away from what the others try.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep

import matplotlib.pyplot as plt
import optuna

import surehold as sh
from surehold.studies import RobotStudy, SearchSpace, StudySettings

optuna.logging.set_verbosity(optuna.logging.WARNING)
function, noise = sh.problems.GM(), sh.InputNoise.unit(0.1)


def robot(name, study):
    """Make a third of the trials."""
    made = []
    for _ in range(12):
        trial = study.ask(name)
        sleep(0.01)
        study.tell(trial.id, float(function([trial.parameters[n] for n in function.box.names])))
        made.append(tuple(trial.parameters.values()))
    return made


with TemporaryDirectory() as folder:
    settings = StudySettings(SearchSpace(function.box), noise, {}, {"seed": 0, "n_initial": 12})
    study = RobotStudy.create("rig", settings, str(Path(folder, "journal.log")))
    with ThreadPoolExecutor(3) as pool:
        trials = list(pool.map(lambda name: robot(name, study), ("left", "middle", "right")))
    best = study.recommend().parameters
    study.close()

figure, axes = plt.subplots(figsize=(5.4, 4))
for name, made in zip(("left", "middle", "right"), trials, strict=True):
    axes.plot(*zip(*made, strict=True), "o", label=name)
axes.plot(*best.values(), "*", color="k", markersize=14, label="recommended")
axes.set(xlabel=function.box.names[0], ylabel=function.box.names[1])
axes.legend()
figure.tight_layout()
