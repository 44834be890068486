"""Growth of an ask with trials and variables, with the default settings: `python -m benchmarks.growth [n ...]`.

For every n, 2 and 7 variables, exact inputs and input noise, a fresh process is given n trials and asked once (cold:
hyperparameters are learnt), then told and asked four times (warm, the median). CPU seconds on one core without the
compilation of kernels, and the peak memory of the process. Then asks in 100 and 1,000 variables after the default
initial design, the median of four.
"""

import subprocess
import sys
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.arguments import chosen
from benchmarks.suggestion_time import response
from surehold.optimization.compilation import compile_now

SIZES = (300, 1000, 3000, 10000)
DIMENSIONS = (2, 7)
NOISES = {"exact": None, "input noise": 0.02}
ASKS = 4
VARIABLES = ((100, "exact"), (100, "input noise"), (1000, "exact"))


def measure(n, d, noise):
    """Return the cold and the median warm CPU seconds of an ask at n trials in d inputs, and the peak memory in MB."""
    input_noise = None if noise is None else sh.InputNoise.unit(noise)
    with threadpool_limits(1):
        for trials in (40, n):  # the first one loads kernels
            optimizer = sh.Optimizer(sh.Box.unit(d), n_initial=1, input_noise=input_noise)
            tried = qmc.LatinHypercube(d, rng=0).random(trials)
            optimizer.restore(tried, [response(u) for u in tried])
            times = []
            for _ in range(ASKS + 1):
                start = time.process_time()
                u = optimizer.ask()
                times.append(time.process_time() - start)
                optimizer.tell(u, response(u))
    return times[0], float(np.median(times[1:])), peak_memory()


def peak_memory():
    """Return the most memory that this process has held, in MB; without that of the process that started it."""
    with open("/proc/self/status", encoding="utf-8") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024.0


def rows(sizes=SIZES):
    """Yield a name and (cold, warm, MB) of every setting, each measured in a process of its own."""
    for noise in NOISES.values():  # those of many trials, too: what the processes load must be there
        compile_now({"input_noise": None if noise is None else sh.InputNoise.unit(noise)})
    for d in DIMENSIONS:
        for name, noise in NOISES.items():
            for n in sizes:
                code = f"from benchmarks.growth import measure; print(*measure({n}, {d}, {noise}))"
                said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
                cold, warm, memory = map(float, said.split())
                yield f"n = {n}, d = {d}, {name}", (cold, warm, memory)


def in_many_variables():
    """Yield a name and the median CPU seconds of an ask in many variables, after the initial design."""
    for d, name in VARIABLES:
        noise = NOISES[name]
        with threadpool_limits(1):
            optimizer = sh.Optimizer(sh.Box.unit(d), input_noise=None if noise is None else sh.InputNoise.unit(noise))
            times = []
            for i in range(optimizer.n_initial + ASKS + 1):
                start = time.process_time()
                u = optimizer.ask()
                if i > optimizer.n_initial:  # the first one by the model loads kernels
                    times.append(time.process_time() - start)
                optimizer.tell(u, response(u))
        yield f"d = {d}, {name}", float(np.median(times))


def main():
    print(f"{'':32} {'cold s':>10} {'warm s':>10} {'MB':>8}")
    for name, (cold, warm, memory) in rows(chosen(__doc__, SIZES, name="n")):
        print(f"{name:32} {cold:10.3f} {warm:10.3f} {memory:8.0f}", flush=True)
    for name, seconds in in_many_variables():
        print(f"{name:32} {'':10} {seconds:10.3f}", flush=True)


if __name__ == "__main__":
    main()
