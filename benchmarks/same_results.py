"""Does a change of the structure change results? Some twenty runs and two hundred grasps, bit for bit.

    python -m benchmarks.same_results record FILE     at the commit before
    python -m benchmarks.same_results compare FILE    at the commit after, on the same machine

Numbers are stored as hexadecimal floats. Between machines the last bits differ, which the chains of
hyperparameters amplify; `tests/test_same_results.py` therefore compares shorter runs with a tolerance.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import surehold as sh

OBJECTS = ("mug", "bottle", "glass", "drill")
SEVEN = ("dx", "dy", "dz", "rx", "ry", "rz", "s1")

#: name of a run -> (problem, trials, settings of the optimizer)
RUNS: Mapping[str, tuple[str, int, dict[str, Any]]] = {
    "plain": ("gm", 40, {}),
    "plain, ei": ("gm", 30, {"criterion": "ei"}),
    "plain, pi": ("rkhs", 20, {"criterion": "pi"}),
    "plain, ucb": ("gf", 20, {"criterion": "ucb", "kappa": 1.5}),
    "thompson": ("gm", 20, {"criterion": "thompson"}),
    "tree": ("gm", 45, {"surrogate": "tgp"}),
    "local-global": ("rkhs", 16, {"surrogate": "local_global"}),
    "robust": ("gm", 40, {"input_noise": 0.1}),
    "robust thompson": ("gm", 20, {"input_noise": 0.1, "criterion": "robust_thompson"}),
    "unscented": ("gm", 24, {"input_noise": 0.1, "criterion": "uei"}),
    "robust tree": ("gm", 36, {"input_noise": 0.1, "surrogate": "tgp"}),
    "robust, clip": ("rkhs", 16, {"input_noise": 0.05, "border": "clip"}),
    "robust, keep": ("rkhs", 16, {"input_noise": 0.05, "border": "keep"}),
    "cvar": ("gm", 15, {"input_noise": 0.1, "risk": "cvar"}),
    "worst": ("gm", 18, {"input_noise": 0.1, "risk": "worst"}),
    "mean-std": ("rkhs", 12, {"input_noise": 0.05, "risk": "mean-std"}),
    "known noise": ("gm", 24, {"noise": 0.01}),
    "inferred noise": ("gm", 24, {"noise": "inferred"}),
    "heteroscedastic": ("rkhs", 16, {"noise": "heteroscedastic"}),
    "straying": ("gm", 24, {"input_noise": 0.1, "noise_while_exploring": True}),
    "trust region": ("gm", 24, {"trust_region": True}),
    "thesis": ("rkhs", 12, {"preset": "thesis-rkhs"}),
    "thesis tree": ("rkhs", 14, {"preset": "thesis-rkhs", "surrogate": "tgp"}),
    "thesis under noise": ("rkhs", 10, {"preset": "thesis-rkhs", "input_noise": 0.05}),
    "grasp": ("mug", 30, {"input_noise": 0.05}),
}

FACETS = ("right-front", "top-front", "left-front", "front-top")
GRASP_OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"contact": "patch"},
    {"contact": "single", "cones": "polyhedral"},
    {"quality": "signed_epsilon", "closing": "synergy"},
    {"quality": "simox", "collision": "zero"},
)


def _problem(name: str) -> Any:
    if name in OBJECTS:
        return sh.problems.GraspProblem(name, facet="right-front", variables=("dx", "dy"))
    return {"rkhs": sh.problems.RKHS, "gf": sh.problems.GF, "gm": sh.problems.GM}[name]()


def run(name: str, trials: int | None = None) -> list[float]:
    """Return the inputs of a run, trial by trial, and at its end the recommended input with mean and quantile."""
    problem_name, budget, settings = RUNS[name]
    problem = _problem(problem_name)
    settings = {"surrogate": "gp", **settings}  # what was the default when the first results were stored
    if "input_noise" in settings:
        settings["input_noise"] = sh.InputNoise.unit(settings["input_noise"])
    n_initial = None if problem_name in OBJECTS else 6
    optimizer = sh.Optimizer(problem.box, seed=1, n_initial=n_initial, **settings)
    rng = np.random.default_rng(7)
    for _ in range(min(budget, trials or budget)):
        x = optimizer.ask()
        noise = 0.01 * rng.standard_normal() if settings.get("noise") or "heteroscedastic" in name else 0.0
        optimizer.tell(x, float(problem(x)) + noise)
    best = optimizer.recommend()
    return [*optimizer.X.ravel().tolist(), *best.x.tolist(), best.mean, best.quantile]


def grasps(each: int = 12) -> Iterator[tuple[str, list[float]]]:
    """Yield a name and the quality and joint angles of random grasps, `each` for 20 pairs of object and options."""
    for o, obj in enumerate(OBJECTS):
        for k, options in enumerate(GRASP_OPTIONS):
            facet = FACETS[(o + k) % len(FACETS)]
            problem = sh.problems.GraspProblem(obj, facet=facet, variables=SEVEN, **{"quality": "epsilon", **options})
            rng = np.random.default_rng([o, k])
            for i in range(each):
                x = problem.box.from_unit(0.5 + 0.35 * (rng.random(7) - 0.5))
                outcome = problem.grasp(x)
                yield f"{obj} {facet} {k} {i}", [outcome.quality, *np.ravel(outcome.joints).tolist()]


def measure() -> dict[str, list[str]]:
    """Return every number of every run and grasp as hexadecimal text."""
    results = {f"run {name}": run(name) for name in RUNS}
    results |= {f"grasp {name}": values for name, values in grasps()}
    return {name: [float(value).hex() for value in values] for name, values in results.items()}


def main() -> int:
    """Record, or compare and exit with 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    arguments = parser.parse_args()
    if arguments.what == "record":
        arguments.file.write_text(json.dumps(measure(), indent=1))
        return 0
    before, after = json.loads(arguments.file.read_text()), measure()
    different = [name for name in before if before[name] != after.get(name)]
    for name in different:
        old, new = ([float.fromhex(text) for text in side.get(name, [])] for side in (before, after))
        first = next((i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), -1)
        print(f"{name}: differs from number {first} on, {old[first]} before, {new[first] if new else None} now")
    print(f"{len(before) - len(different)} of {len(before)} results are the same bit for bit")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
