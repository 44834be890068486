"""Which search finds the grasp that physics holds more often: by quality, or by the verdict itself.

python -m benchmarks.held_grasps [--objects mug bottle glass] [--seeds 4] [--trials 60]

Both searches have the same trials, initial design and input noise (3 % of the box). Their answers are executed 200
times with the same perturbations, and every execution is checked in MuJoCo. Printed are the shares held, their paired
difference with its standard error over seeds, and the CPU seconds of a search.
"""

import argparse
import time
from typing import Any

import numpy as np

import surehold as sh
from surehold.problems import GraspProblem, HeldGrasp
from surehold.problems.perturbation import perturbed_points

NOISE = sh.InputNoise.unit(0.03)
CHECKS = 200


def run(name: str, seed: int, trials: int) -> tuple[list[float], list[float]]:
    """Return the shares held of both answers, by quality and by verdict, and the CPU seconds of both searches."""
    problem = GraspProblem(name)
    held = HeldGrasp(problem)
    shares, seconds = [], []
    searches: list[tuple[Any, dict[str, Any]]] = [(problem, {}), (held, {"outcome": "success"})]
    for function, settings in searches:
        began = time.process_time()
        options: dict[str, Any] = {"input_noise": NOISE, "seed": seed, "n_initial": trials // 2, **settings}
        found = sh.maximize(function, problem.box, trials, progress=False, **options).recommendation.x
        seconds.append(time.process_time() - began)
        shares.append(float(np.mean(held(perturbed_points(found, problem.box, NOISE, CHECKS, seed)))))
    return shares, seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="*", default=["mug", "bottle", "glass"])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--trials", type=int, default=60)
    arguments = parser.parse_args()
    print(f"{'object':8} {'by quality':>11} {'by verdict':>11} {'difference (se)':>18} {'CPU s':>14}")
    for name in arguments.objects:
        rows = [run(name, seed, arguments.trials) for seed in range(arguments.seeds)]
        shares, seconds = np.array([row[0] for row in rows]), np.mean([row[1] for row in rows], axis=0)
        gap = shares[:, 1] - shares[:, 0]
        error = gap.std(ddof=1) / np.sqrt(len(gap))
        means = shares.mean(axis=0)
        times = f"{seconds[0]:.0f} and {seconds[1]:.0f}"
        print(f"{name:8} {means[0]:11.3f} {means[1]:11.3f} {gap.mean():+10.3f} ({error:.3f}) {times:>14}", flush=True)


if __name__ == "__main__":
    main()
