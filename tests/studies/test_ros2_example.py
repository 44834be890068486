"""The part of the ROS 2 example that holds no ROS, against a real service; the node itself is checked as text."""

import ast
import importlib
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.stop_rule import StopRule

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2"
TOKEN = "a-token-of-the-robot"


@pytest.fixture
def modules(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE / "surehold_ros"))
    yield importlib.import_module("surehold_ros.client"), importlib.import_module("surehold_ros.exploration")
    for name in [name for name in sys.modules if name.startswith("surehold_ros")]:
        del sys.modules[name]


def serve(url, port=0):
    command = [sys.executable, "-m", "surehold", "study", "serve", "mug", "--storage", url, "--token", TOKEN]
    process = subprocess.Popen([*command, "--port", str(port)], stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split(" at ")[1].split("/ ")[0]


def stop(process):
    process.terminate()
    process.communicate(timeout=600)


def test_exploring_survives_the_robot_and_the_service(tmp_path, modules):
    client_module, exploration = modules
    url = str(tmp_path / "journal.log")
    space = SearchSpace({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
    study = RobotStudy.create("mug", StudySettings(space, units={"dx": "m"}, optimizer={"n_initial": 5}), url)
    study.set_stop_rule(StopRule(trials=9))
    process, address = serve(url)
    client = client_module.StudyClient(address, "mug", TOKEN)
    asked = []

    def make(trial):
        asked.append(trial)
        if len(asked) == 2:
            raise RuntimeError("the robot's controller dies")
        if len(asked) == 4:
            return exploration.Made(float("nan"))
        p = trial["parameters"]
        return exploration.Made(-abs(p["dx"]), reached={"dy": p["dy"] / 2.0})

    with pytest.raises(RuntimeError):
        exploration.explore(client, "arm", make)
    assert exploration.explore(client, "arm", make, trials=2) == (2, "2 trials were made")
    assert (asked[2]["id"], asked[2]["again"]) == (asked[1]["id"], True)
    stop(process)
    process, _ = serve(url, int(address.rsplit(":", 1)[1]))  # the same port, a new process
    made, why = exploration.explore(client, "arm", make)
    assert (made, "budget of 9 trials" in why) == (6, True)
    best = client.recommendation()
    assert best["units"] == {"dx": "m"}
    assert study.trials()[2].state.name == "FAIL"
    assert len(study.trials()) == 9
    study.set_stop_rule(StopRule())
    trial = client.ask("arm")
    assert client.tell(trial["id"], -1.0)["already"] is False
    with pytest.raises(client_module.Refused, match="told before") as refused:
        client.tell(trial["id"], -2.0)
    assert refused.value.code == 409
    stranger = client_module.StudyClient(address, "mug", "wrong")
    with pytest.raises(client_module.Refused, match="token"):
        stranger.ask("arm")
    stop(process)
    began = time.monotonic()
    with pytest.raises(OSError, match="refused"):
        client_module.StudyClient(address, "mug", TOKEN, patience=1.0).ask("arm")
    assert time.monotonic() - began >= 1.0


def fields(text):
    """Return the names of the fields of each part of an interface file."""
    parts = re.split(r"^---$", text, flags=re.MULTILINE)
    lines = [[line.partition("#")[0].split() for line in part.splitlines()] for part in parts]
    return [{words[1] for words in part if words} for part in lines]


def test_the_node_uses_the_fields_that_there_are():
    tree = ast.parse((EXAMPLE / "surehold_ros" / "surehold_ros" / "explorer.py").read_text())
    interfaces = {p.stem: fields(p.read_text()) for p in (EXAMPLE / "surehold_interfaces").glob("*/*.*")}
    listed = (EXAMPLE / "surehold_interfaces" / "CMakeLists.txt").read_text()
    assert all(f"{name}." in listed for name in interfaces)
    known = {field for parts in interfaces.values() for part in parts for field in part}
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in ("request", "response", "result", "answer")
    }
    assert used - {"stopped"} <= known | {"result"}
    assert {"Ask", "Tell", "MakeTrial", "Explore"} == set(interfaces)
