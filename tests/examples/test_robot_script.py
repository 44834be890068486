"""The robot in bash, against the service as a user starts it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from surehold.cli import run

SCRIPT = Path(__file__).parents[2] / "examples" / "robot.sh"
pytest.importorskip("fastapi")
pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("bash", "curl", "jq"))), reason="the robot needs bash, curl and jq"
)


def test_a_robot_in_bash_finds_the_place(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SUREHOLD_TOKEN", "a-token-of-16-characters")
    assert run(["study", "create", "arm", "--parameters", "dx=-0.05:0.05,grip=pinch/power", "--noise", "dx=0.003"]) == 0
    command = [sys.executable, "-m", "surehold", "study", "serve", "arm", "--port", "0"]
    with subprocess.Popen(command, env={**os.environ}, stdout=subprocess.PIPE, text=True) as served:
        try:
            address = served.stdout.readline().split(" at ")[1].split("/ ")[0]
            robot = subprocess.run(
                ["bash", SCRIPT, f"{address}/studies/arm", "22"], capture_output=True, text=True, timeout=600
            )
            refused = subprocess.run(
                ["bash", SCRIPT, f"{address}/studies/leg", "1"], capture_output=True, text=True, timeout=600
            )
        finally:
            served.terminate()
    assert robot.returncode == 0, robot.stderr + robot.stdout
    found = json.loads(robot.stdout)
    assert found["parameters"]["grip"] == "power"
    assert abs(found["parameters"]["dx"] - 0.01) < 0.004
    assert refused.returncode != 0
    assert "leg" in refused.stderr, "it says why"
