"""Workers end when the process that they work for is killed, in which nothing can end them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

RIG = """
import os, time
from pathlib import Path
def quality(x):
    Path("workers", str(os.getpid())).touch()
    time.sleep(0.05)
    return -x[0] ** 2
"""

PLAN = """
title: Two workers
runs: 1000
problems:
  rig: {function: "rig.py:quality", arguments: {bounds: "x=0:1"}, trials: 2, initial: 2}
methods:
  random: {optimizer: random}
"""

MAXIMIZE = "import rig, surehold as sh; sh.maximize(rig.quality, sh.Box({'x': (0, 1)}), n_trials=1000, n_jobs=2)"

POOLS = {
    "maximize": ["-c", MAXIMIZE],
    "campaign": ["-m", "surehold", "campaign", "run", "plan.yaml", "--workers", "2", "--out", "out"],
}


def _running(pid):
    """Tell whether a process runs; one that has ended and that nobody has asked for is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def _until(condition):
    deadline = time.monotonic() + 300.0
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="there is no /proc")
@pytest.mark.parametrize("pool", POOLS)
def test_workers_end_with_a_process_that_is_killed(pool, tmp_path):
    (tmp_path / "rig.py").write_text(RIG)
    (tmp_path / "plan.yaml").write_text(PLAN)
    workers = tmp_path / "workers"
    workers.mkdir()
    command, here = [sys.executable, *POOLS[pool]], os.environ | {"SUREHOLD_WARM_UP": "0"}
    with open(tmp_path / "said", "w") as said:
        parent = subprocess.Popen(command, cwd=tmp_path, env=here, stdout=said, stderr=said)
    try:
        assert _until(lambda: len(list(workers.iterdir())) == 2 or parent.poll() is not None)
        assert parent.poll() is None, (tmp_path / "said").read_text()
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    pids = [path.name for path in workers.iterdir()]
    assert _until(lambda: not any(map(_running, pids)))
