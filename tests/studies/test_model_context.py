"""The tools of a study under the real client of the protocol: in one process, and over the standard streams."""

import asyncio
import json
import os
import sys

import pytest

import surehold as sh
from surehold.studies import RobotStudy, SearchSpace, StudySettings
from surehold.studies.history import REACHED

pytest.importorskip("mcp")

from mcp.client import Client
from mcp.client.stdio import StdioServerParameters, stdio_client

from surehold.studies.model_context import model_context_server

NOISE = sh.InputNoise.unit(0.03)
RKHS = sh.problems.RKHS()


@pytest.fixture
def study(tmp_path):
    settings = StudySettings(SearchSpace(RKHS.box), NOISE, {}, {"seed": 0, "n_initial": 8})
    opened = RobotStudy.create("hill", settings, str(tmp_path / "journal.log"))
    yield opened
    opened.close()


def test_a_loop_finds_what_holds(study):
    async def loop():
        async with Client(model_context_server(study)) as client:
            for _ in range(25):
                asked = (await client.call_tool("ask", {"worker": "me"})).structured_content
                value = float(RKHS(list(asked["parameters"].values())))
                await client.call_tool("tell", {"id": asked["id"], "value": value})
            return (await client.call_tool("recommend", {})).structured_content

    answer = asyncio.run(loop())
    x = list(answer["parameters"].values())
    best = sh.problems.robust_optimum(RKHS, NOISE).x
    held, most = (sh.problems.robust_score(RKHS, at, NOISE, n=500, seed=1).mean for at in (x, best))
    assert held > 0.97 * most


def test_counts_of_successes(tmp_path):
    settings = StudySettings(SearchSpace(RKHS.box), NOISE, {}, {"seed": 0, "outcome": "success"})
    held = RobotStudy.create("held", settings, str(tmp_path / "journal.log"))

    async def loop():
        async with Client(model_context_server(held)) as client:
            id = (await client.call_tool("ask", {})).structured_content["id"]
            told = await client.call_tool("tell", {"id": id, "successes": 7, "of": 10})
            wrong = await client.call_tool("add", {"parameters": {"x": 0.5}, "successes": 8, "of": 7})
            await client.call_tool("add", {"parameters": {"x": 0.5}, "successes": 3, "of": 4})
            await client.call_tool("add", {"parameters": {"x": 0.25}, "value": "success"})
            return told, wrong, (await client.call_tool("trials", {})).structured_content["trials"]

    told, wrong, trials = asyncio.run(loop())
    assert told.structured_content == {"id": 0, "state": "complete", "value": 0.7, "already": False, "of": 10}
    assert wrong.is_error
    assert "successes are 8 of 7" in wrong.content[0].text
    assert [(trial["value"], trial["of"]) for trial in trials] == [(0.7, 10), (0.75, 4), (1.0, 1)]
    held.close()


def test_refusals_are_errors_of_the_tool(study):
    async def refused():
        async with Client(model_context_server(study)) as client:
            asked = (await client.call_tool("ask", {})).structured_content
            await client.call_tool("tell", {"id": asked["id"], "value": 1.0})
            again = await client.call_tool("tell", {"id": asked["id"], "value": 2.0})
            unknown = await client.call_tool("tell", {"id": 99, "value": 2.0})
            state = (await client.call_tool("status", {})).structured_content
            return again, unknown, state

    again, unknown, state = asyncio.run(refused())
    assert again.is_error
    assert unknown.is_error
    assert unknown.content[0].text == "trial 99 is not in study 'hill'; the last one is 0."
    assert state["complete"] == 1
    assert state["best_value"] == 1.0


@pytest.mark.parametrize(
    ("tool", "arguments", "words"),
    [
        ("tell", {"id": 0, "value": True}, "'True' was told, but this study is told values"),
        ("tell", {"id": 0, "value": "0.5"}, 'value is "0.5"; send a finite number, or leave it out and send failed'),
        ("tell", {"id": 0, "value": "high"}, 'value is "high"; send a finite number'),
        ("tell", {"id": 0, "value": 0.5, "reachd": {"x": 0.5}}, "field 'reachd' is unknown; did you mean 'reached'?"),
        ("tell", {"id": 0, "vaule": 0.5}, "field 'vaule' is unknown; did you mean 'value'?"),
        ("tell", {"id": "0", "value": 0.5}, 'id is "0"; it must be a valid integer.'),
        ("tell", {"value": 0.5}, "field 'id' is missing; send {\"id\": ...}, where wanted with value"),
        ("tell", {"id": 0, "failed": "yes"}, 'failed is "yes"; send true, false, or "rig" in tell.'),
        ("tell", {"id": 0, "value": 0.5, "reached": {"x": [1]}}, "reached.x is [1]; send a finite number"),
        ("add", {"parameters": {"x": 0.5}, "value": "1"}, 'value is "1"; send a finite number'),
        ("ask", {"wroker": "me"}, "field 'wroker' is unknown; did you mean 'worker'?"),
        ("recommend", {"id": 0}, "field 'id' is unknown."),
    ],
)
def test_wrong_arguments_change_nothing_and_are_told_in_the_words_of_the_service(study, tool, arguments, words):
    study.ask()

    async def refused():
        async with Client(model_context_server(study)) as client:
            return await client.call_tool(tool, arguments), await client.list_tools()

    answer, listed = asyncio.run(refused())
    assert answer.is_error
    assert answer.content[0].text.startswith(words)
    assert [trial.state.name for trial in study.trials()] == ["RUNNING"]
    assert all(found.input_schema["additionalProperties"] is False for found in listed.tools)


def test_objects_as_text_are_taken(study):
    """Some hosts send them so."""
    id = study.ask().id

    async def told():
        async with Client(model_context_server(study)) as client:
            return await client.call_tool("tell", {"id": id, "value": 1, "reached": '{"x": 0.5}'})

    assert not asyncio.run(told()).is_error
    assert study.trials()[id].user_attrs[REACHED] == {"x": 0.5}


def test_the_command_over_the_standard_streams(study):
    command = ["-m", "surehold", "study", "mcp", "hill", "--storage", study.storage.shown]

    async def asked():
        server = StdioServerParameters(command=sys.executable, args=command, env=dict(os.environ))
        async with Client(stdio_client(server)) as client:
            tools = {tool.name for tool in (await client.list_tools()).tools}
            return tools, await client.call_tool("ask", {})

    tools, answer = asyncio.run(asked())
    assert {"ask", "tell", "recommend", "next_trial", "add", "status", "trials"} == tools
    assert json.loads(answer.content[0].text)["id"] == 0
    assert len(study.trials()) == 1


def test_limits_and_what_was_not_the_place(tmp_path):
    settings = StudySettings(SearchSpace(RKHS.box), NOISE, {}, {"seed": 0, "constraints": {"torque": [None, 3.0]}})
    limited = RobotStudy.create("limited", settings, str(tmp_path / "journal.log"))

    async def loop():
        async with Client(model_context_server(limited)) as client:
            id = (await client.call_tool("ask", {})).structured_content["id"]
            lacking = await client.call_tool("tell", {"id": id, "value": 1.0})
            told = await client.call_tool("tell", {"id": id, "value": 1.0, "constraints": {"torque": 2.0}})
            added = {"parameters": {"x": 0.5}, "value": 2.0, "constraints": {"torque": 4.0}}
            await client.call_tool("add", added)
            other = (await client.call_tool("ask", {})).structured_content["id"]
            rig = await client.call_tool("tell", {"id": other, "failed": "rig"})
            return lacking, told, rig, (await client.call_tool("trials", {})).structured_content["trials"]

    lacking, told, rig, trials = asyncio.run(loop())
    assert "torque" in lacking.content[0].text
    assert told.structured_content["value"] == 1.0
    assert not rig.is_error
    assert [trial["value"] for trial in trials[:2]] == [1.0, 2.0]
    limited.close()
