"""Growth of the treed Gaussian process with the number of trials: `python -m benchmarks.treed_growth [n ...]`.

For every n a fresh process is told n - 3 trials in two inputs and asked for one more (cold: every leaf that is looked
at is learnt), then told and asked three times (warm: what a run pays for a suggestion). CPU seconds on one core, and
the peak memory of the process, imports included. The yardstick is the CPU time of LAPACK dpotrf on a 140 x 140 matrix.
"""

import subprocess
import sys
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.arguments import chosen
from benchmarks.suggestion_time import response, yardstick

SIZES = (100, 300, 1000, 3000, 10000)
ASKS = 3
NOISES = {"exact": None, "input noise": sh.InputNoise.unit(0.02)}


def measure(n, noise):
    """Print leaves, cold and median warm CPU seconds of a suggestion, and peak memory in MB."""
    import resource

    box = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    with threadpool_limits(1):
        compiled = sh.Optimizer(box, surrogate="tgp", n_initial=40, input_noise=noise)  # compile outside the clock
        for u in qmc.LatinHypercube(2, rng=1).random(40):
            compiled.tell(u, response(u))
        compiled.ask()
        optimizer = sh.Optimizer(box, surrogate="tgp", n_initial=1, input_noise=noise)
        for u in qmc.LatinHypercube(2, rng=0).random(n - ASKS):
            optimizer.tell(u, response(u))
        times = []
        for _ in range(ASKS + 1):
            start = time.process_time()
            u = optimizer.ask()
            times.append(time.process_time() - start)
            optimizer.tell(u, response(u))
    leaves = optimizer.posterior.diagnostics.partition.leaves
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"{leaves:8} {times[0]:12.3f} {np.median(times[1:]):12.3f} {memory:12.0f}")


def main():
    sizes = chosen(__doc__, SIZES, name="n")
    with threadpool_limits(1):
        print(f"yardstick: dpotrf 140 x 140 takes {1e3 * yardstick():.3f} ms")
    print(f"{'':12} {'n':>8} {'leaves':>8} {'cold s':>12} {'warm s':>12} {'MB':>12}")
    for name in NOISES:
        for n in sizes:
            code = f"from benchmarks.treed_growth import NOISES, measure; measure({n}, NOISES[{name!r}])"
            line = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
            print(f"{name:12} {n:8} {line.rstrip()}", flush=True)


if __name__ == "__main__":
    main()
