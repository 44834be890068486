"""Strange input for some minutes: no traceback, no hang, no more memory than stated.

python -m benchmarks.fuzz [--minutes 10] [--seed 0] [--parts calls files service]

Each part runs in a process of its own, with 6 GB of address space, for its share of the time. A fault is anything but a
result or an error of one line, and a call without an answer in 30 seconds of the processor. The exit code is 1 if there
was one.
"""

import argparse
import multiprocessing
import sys
import tempfile
from pathlib import Path

from benchmarks.fuzz.findings import SECONDS
from benchmarks.fuzz.part import run

PARTS = ("calls", "files", "service")


def main() -> None:
    """Run the parts one after another."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="for all parts together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parts", nargs="*", default=list(PARTS), choices=PARTS)
    arguments = parser.parse_args()
    seconds, worst = 60.0 * arguments.minutes / len(arguments.parts), 0
    spawn = multiprocessing.get_context("spawn")
    for part in arguments.parts:
        with tempfile.TemporaryDirectory() as name:
            process = spawn.Process(target=run, args=(part, arguments.seed, seconds, Path(name)))
            process.start()
            process.join(seconds + 20 * SECONDS)
            if process.exitcode not in (0, 1):  # killed by a signal, or never ending
                process.kill()
                last = (Path(name) / "under way").read_text()[:600]
                print(f"{part}: ended with {process.exitcode} in {last}", flush=True)
            worst = max(worst, 0 if process.exitcode == 0 else 1)
    sys.exit(worst)


if __name__ == "__main__":
    main()
