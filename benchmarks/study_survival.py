"""What is left of a study whose workers are killed with -9 at random.

    python -m benchmarks.study_survival [URL] [--workers 4] [--trials 200] [--every 4]

Starts `surehold study work` in several processes on one storage, kills a random one every few seconds and starts
another in its place, until the study's budget is used up. Then it counts: trials finished, parameters that occur twice,
trials left running, answers that the workers' own record holds and the study does not, and whether the recommendation
of the study is the one that an optimizer gives that is told the stored trials.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from optuna.trial import TrialState

import surehold as sh
from surehold.studies.ledger import holder_of
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.stop_rule import StopRule

# The trial: takes a while, and writes down what it answers before it does, beside the study.
RIG = """
import json, os, time
def rig(x):
    time.sleep({seconds})
    value = 1.0 - 4.0 * abs(float(x[0]) - 0.3) - 2.0 * abs(float(x[1]) - 0.6)
    with open({record!r}, "a") as record:
        record.write(json.dumps([list(map(float, x)), value]) + "\\n")
    return value
"""
BOX = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
NOISE = sh.InputNoise.unit(0.03)


def survive(
    url: str, workers: int, trials: int, every: float, seconds: float, lifetime: float, most: int = 10**9
) -> dict:
    """Run the experiment on a new storage with at most so many kills, and return what it found."""
    rng = random.Random(0)
    folder = Path(tempfile.mkdtemp(prefix="surehold-survival-"))
    record = folder / "record.jsonl"
    record.touch()
    (folder / "rig.py").write_text(RIG.format(seconds=seconds, record=str(record)))
    settings = StudySettings(SearchSpace(BOX), NOISE, optimizer={"seed": 0, "n_initial": 10})
    study = RobotStudy.create("killed", settings, url)
    study.set_stop_rule(StopRule(trials=trials))
    command = [sys.executable, "-m", "surehold", "study", "work", "killed", "--storage", url]
    command += ["--function", f"{folder}/rig.py:rig", "--lifetime", str(lifetime)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}

    def start() -> subprocess.Popen:
        return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def answered() -> int:
        return len(record.read_text().splitlines())

    began, kills, last = time.monotonic(), 0, time.monotonic()
    running, before = [start() for _ in range(workers)], [0] * workers
    while any(worker.poll() is None for worker in running):
        time.sleep(0.05)
        if kills < most and time.monotonic() - last > every * rng.uniform(0.5, 1.5):
            k = rng.randrange(workers)
            if running[k].poll() is None and answered() > before[k]:  # not before it has had time to start
                last = time.monotonic()
                running[k].kill()
                running[k].communicate()
                kills += 1
                running[k], before[k] = start(), answered()
    ended = [worker.communicate()[1].decode() for worker in running]
    assert all(worker.returncode == 0 for worker in running), ended
    stored = study.trials()
    complete = [t for t in stored if t.state == TrialState.COMPLETE]
    answers = [json.loads(line) for line in record.read_text().splitlines()]
    known = {(t.params["a"], t.params["b"], t.value) for t in complete}
    optimizer = sh.Optimizer(BOX, input_noise=NOISE, seed=0, n_initial=10)
    optimizer.restore([[t.params["a"], t.params["b"]] for t in complete], [t.value for t in complete])
    told, best = optimizer.recommend(), study.recommend()
    study.close()
    return {
        "storage": url.split(":")[0] if "://" in url else "journal",
        "workers": workers,
        "kills": kills,
        "trials": len(stored),
        "complete": len(complete),
        "failed": sum(t.state == TrialState.FAIL for t in stored),
        "left_running": sum(not t.state.is_finished() for t in stored),
        "parameters_twice": len(stored) - len({tuple(t.params.values()) for t in stored}),
        "taken_up_again": sum((holder_of(t) or (0, 0, 1))[2] > 1 for t in stored),
        "answers_given": len(answers),
        # An answer that was given may be missing only where its worker was killed before it could store it.
        "answers_not_stored": sum((*x, y) not in known for x, y in answers),
        "recommendation_agrees": bool(
            np.array_equal(told.x, list(best.parameters.values())) and told.mean == best.mean and told.n == best.n
        ),
        "seconds": round(time.monotonic() - began, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("url", nargs="?", default="")
    parser.add_argument("--workers", type=int, default=4)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--every", type=float, default=4.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        url = options.url or f"{folder}/journal.log"
        found = survive(url, options.workers, options.trials, options.every, seconds=0.3, lifetime=4.0)
    for key, value in found.items():
        print(f"{key:>24}  {value}")


if __name__ == "__main__":
    main()
