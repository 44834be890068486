"""Whether anything is lost or done twice when many clients ask and tell a study over HTTP at once.

python -m benchmarks.study_service [URL] [--trials 1000] [--clients 8] [--seconds 0]

`--seconds`: mean duration of a trial, drawn from an exponential distribution; 0 asks again as soon as an answer was
taken, so that what is measured is how many trials a second the service hands out. The time to the first model, which
may compile, is in the longest ask.
"""

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from statistics import median

import httpx
import numpy as np
from optuna.trial import TrialState

import surehold as sh
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

TOKEN = "benchmark-of-the-service"


def attack(url: str, trials: int, clients: int, duration: float) -> dict[str, object]:
    """Serve a new study in a process of its own, ask and tell, and return what was found."""
    settings = StudySettings(SearchSpace({"a": (0.0, 1.0), "b": (0.0, 1.0)}), sh.InputNoise.unit(0.03))
    study = RobotStudy.create("served", settings, url)
    command = [sys.executable, "-m", "surehold", "study", "serve", "served", "--storage", url, "--port", "0"]
    server = subprocess.Popen([*command, "--token", TOKEN], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    address = server.stdout.readline().split(" at ")[1].split("/ ")[0]
    lock, told, seconds, behind, problems = threading.Lock(), {}, [], [], []
    left = iter(range(trials))

    def client(k: int) -> None:
        rng = np.random.default_rng(k)
        with httpx.Client(base_url=f"{address}/studies/served", timeout=120.0) as own:
            own.headers["Authorization"] = f"Bearer {TOKEN}"
            while True:
                with lock:
                    if next(left, None) is None:
                        return
                began = time.perf_counter()
                asked = own.post("/ask", json={"worker": f"client {k}"})
                asking = time.perf_counter() - began
                if asked.status_code != 200:
                    problems.append(asked.text)
                    continue
                trial = asked.json()
                value = -((trial["parameters"]["a"] - 0.3) ** 2) - (trial["parameters"]["b"] - 0.6) ** 2
                time.sleep(float(rng.exponential(duration)))
                answer = own.post("/tell", json={"id": trial["id"], "value": value})
                with lock:
                    seconds.append(asking)
                    behind.append(trial.get("behind", 0))
                    if answer.status_code != 200 or trial["id"] in told:
                        problems.append(answer.text)
                    told[trial["id"]] = value

    began = time.perf_counter()
    with ThreadPoolExecutor(clients) as pool:
        list(pool.map(client, range(clients)))
    wall = time.perf_counter() - began
    server.terminate()
    server.wait(timeout=30)
    stored = study.trials()
    study.close()
    return {
        "asked and told": len(told),
        "stored": len(stored),
        "complete": sum(t.state == TrialState.COMPLETE for t in stored),
        "values that differ": sum(t.value != told.get(t.number) for t in stored),
        "parameters twice": len(stored) - len({tuple(t.params.values()) for t in stored}),
        "problems": len(problems),
        "seconds": round(wall, 1),
        "ask, median [s]": round(median(seconds), 3),
        "ask, longest [s]": round(max(seconds), 3),
        "second half, median [s]": round(median(seconds[len(seconds) // 2 :]), 3),
        "behind, median": median(behind),
        "behind, most": max(behind),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("url", nargs="?", default="")
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--clients", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=0.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = attack(options.url or f"{folder}/journal.log", options.trials, options.clients, options.seconds)
    for key, value in found.items():
        print(f"{key:>24}  {value}")


if __name__ == "__main__":
    main()
