"""How much faster two workers are than one, and how memory grows: `python -m benchmarks.campaign_workers [runs]`.

Runs the table-4.1 plan's RKHS and GF cells with the defaults, first by one worker, then by two; needs two idle cores.
"""

import resource
import tempfile
import time
from pathlib import Path

from benchmarks.arguments import chosen
from surehold.campaigns.plan_file import load_plan
from surehold.campaigns.runner import run_campaign


def main():
    [runs] = chosen(__doc__, [20], name="runs")
    plan = load_plan("table-4.1-defaults")
    seconds = {}
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(plan, Path(folder) / "warm", runs=1, only=["RKHS", "GF"])
        for workers in (1, 2):
            memory = []
            started = time.perf_counter()
            run_campaign(
                plan,
                Path(folder) / str(workers),
                runs=runs,
                workers=workers,
                only=["RKHS", "GF"],
                observer=lambda progress, row, memory=memory: memory.append(
                    resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
                ),
            )
            seconds[workers] = time.perf_counter() - started
            print(
                f"{workers} worker(s): {len(memory) - 1} runs in {seconds[workers]:.1f} s; peak memory of the caller "
                f"{memory[len(memory) // 4]:.0f} MB after a quarter, {memory[-1]:.0f} MB at the end",
                flush=True,
            )
    print(f"two workers are {seconds[1] / seconds[2]:.2f} times one")


if __name__ == "__main__":
    main()
