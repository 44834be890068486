"""Seconds per suggestion beside other optimizers, on one core: `python -m benchmarks.suggestion_time`.

Each optimizer is given the same n - 12 trials of a function with a smooth and a jagged region, then told and asked
twelve times more (some learn in the one call, some in the other); the median CPU time is printed, as a multiple of that
of surehold's default without input noise, and in units of the CPU time of LAPACK dpotrf on a 140 x 140 matrix measured
in the same run. The first ask, which may compile and import, is left out.
"""

import time

import numpy as np
from scipy.linalg import lapack
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from surehold.campaigns.methods import Surehold
from surehold.campaigns.peers import installed_peers
from surehold.optimization.noise.input_noise import InputNoise

SETTINGS = ((50, 2), (140, 2), (150, 7))
ASKS = 12


def yardstick():
    """Return the CPU seconds of dpotrf on a 140 x 140 matrix, the smallest of 200."""
    A = np.eye(140) + 0.5
    times = []
    for _ in range(200):
        B = A.copy()
        start = time.process_time_ns()
        lapack.dpotrf(B, lower=1, overwrite_a=1)
        times.append(time.process_time_ns() - start)
    return 1e-9 * min(times)


def response(u):
    jagged = 0.2 * np.sin(60.0 * u[0]) * (u[0] > 0.7)
    return float(np.sin(6.0 * u[0]) * np.cos(4.0 * u[1]) + 0.3 * np.sum(u) + jagged)


def seconds_per_ask(maker, n, d):
    """Return the median CPU seconds of telling one trial and asking for the next at n trials in d inputs."""
    optimizer = maker(d, qmc.LatinHypercube(d, rng=0).random(n - ASKS), 0)
    for _ in range(n - ASKS):
        u = optimizer.ask()
        optimizer.tell(u, response(u))
    u = optimizer.ask()
    times = []
    for _ in range(ASKS):
        y = response(u)
        start = time.process_time()
        optimizer.tell(u, y)
        u = optimizer.ask()
        times.append(time.process_time() - start)
    return float(np.median(times))


def main():
    ours = {
        "surehold default": (None, {}),
        "surehold default, input noise": (InputNoise.unit(0.05), {}),
        "surehold gp": (None, {}),
        "surehold gp, input noise": (InputNoise.unit(0.05), {}),
        "surehold tgp": (None, {"surrogate": "tgp"}),
        "surehold tgp, input noise": (InputNoise.unit(0.05), {"surrogate": "tgp"}),
    }
    makers = {name: (lambda d, initial, seed, s=told: Surehold(d, initial, seed, *s)) for name, told in ours.items()}
    with threadpool_limits(1):
        unit = yardstick()
        print(f"yardstick: dpotrf 140 x 140 takes {1e3 * unit:.3f} ms")
        print(f"{'':28}" + "".join(f"{f'n = {n}, d = {d}':>34}" for n, d in SETTINGS))
        base = {}
        for name, maker in {**makers, **installed_peers()}.items():
            cells = []
            for setting in SETTINGS:
                seconds = seconds_per_ask(maker, *setting)
                base.setdefault(setting, seconds)
                cells.append(f"{seconds:10.4f} s {seconds / base[setting]:6.1f} x {seconds / unit:8.0f} u")
            print(f"{name:28}" + "".join(f"{cell:>34}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
