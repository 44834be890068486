"""What it costs in accuracy that of many successes near ones count together: `python -m benchmarks.success_places`.

800 trials, true probability Phi(1.5 cos 5 x0 + 1.2 sin 6 x1), hyperparameters fixed; trials and 400 queries at random,
or three quarters of the trials and all queries around one place (deviation 0.08). Printed: root mean square of stated
minus true probability by all trials apart and by 400 places, the largest difference of the two, and CPU seconds.
"""

import argparse
import time

import numpy as np
from scipy.special import ndtr

from surehold.optimization.numerics.threads import single_threaded
from surehold.optimization.surrogates.success import model


def stated(X, y, Q, scale, places):
    """Return probabilities at Q by at most this many places, and CPU seconds."""
    before, model.SUCCESS_PLACES, started = model.SUCCESS_PLACES, places, time.process_time()
    process = model.SuccessProcess(length_scales=np.full(X.shape[1], scale), signal_variance=2.0)
    with single_threaded():
        found = process.condition(X, y, np.random.default_rng(0)).moments(Q).mean[0]
    model.SUCCESS_PLACES = before
    return found, time.process_time() - started


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    for d, scale in ((2, 0.3), (3, 0.35), (3, 0.2)):
        for close in (False, True):
            rows = []
            for seed in range(arguments.seeds):
                rng = np.random.default_rng(seed)
                X, Q = rng.random((800, d)), rng.random((400, d))
                if close:
                    X[200:] = np.clip(0.6 + 0.08 * rng.standard_normal((600, d)), 0.0, 1.0)
                    Q = np.clip(0.6 + 0.08 * rng.standard_normal((400, d)), 0.0, 1.0)
                p, truth = (ndtr(1.5 * np.cos(5.0 * U[:, 0]) + 1.2 * np.sin(6.0 * U[:, 1])) for U in (X, Q))
                y = (rng.random(800) < p).astype(float)
                (apart, long), (near, short) = (stated(X, y, Q, scale, places) for places in (800, 400))
                off = [np.sqrt(np.mean((part - truth) ** 2)) for part in (apart, near)]
                rows.append([*off, np.abs(apart - near).max(), long, short])
            a, b, most, long, short = np.mean(rows, axis=0)
            where = "around one place" if close else "at random"
            figures = (
                f"rms {a:.4f} apart, {b:.4f} together; largest difference {most:.3f}; {long:.2f} and {short:.2f} s"
            )
            print(f"d = {d}, length-scale {scale}, {where:16} {figures}", flush=True)


if __name__ == "__main__":
    main()
