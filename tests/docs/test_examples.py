"""Everything that README and site show is executed: Python as doctests, commands as a person would type them.

A page is one session in an empty folder: first its Python, then its `console` and `sh` blocks, each command of which
must end with 0. What a page takes for granted, such as a hand of one's own, is laid there first, and runs of a hundred
trials are made with a dozen. `ELSEWHERE` names the commands of `sh` blocks that are only read by the command line here,
so that no option is wrong, and what runs them. Links between pages are checked while the site is built.
"""

import doctest
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from surehold.campaigns.plan_file import parse_plan
from surehold.cli import run
from surehold.grasping.hand.configuration import HandConfig

ROOT = Path(__file__).parents[2]
PAGES = sorted(page for page in (ROOT / "docs").glob("*/*.md") if page.parent.name != "generated")
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *PAGES]}
LANGUAGES = {"python", "console", "sh", "yaml", "text"}

#: beginning of a command that no page's session runs -> where it is run, or why it is not
ELSEWHERE = {
    "pip install": "release: in a bare environment",
    "make grasp": "release: in a fresh clone",
    "createdb": "test_the_commands_for_postgresql",
    "surehold study create crowd --problem gm --noise 0.1 --storage postgresql": "test_the_commands_for_postgresql",
    "surehold study work crowd --storage postgresql": "test_the_commands_for_postgresql",
    "SUREHOLD_TOKEN=a-token-of-16-characters surehold study serve": "tests/examples/test_robot_script.py",
    "surehold study mcp": "tests/studies/test_model_context.py",
    "dask": "needs a cluster; tests/campaigns has one of processes",
    "surehold campaign run plan.yaml --backend dask": "needs a cluster",
    "surehold campaign run table-4.1": "hours",
    "surehold campaign report runs/campaigns/table-4.1": "hours before",
    "ros2": "needs ROS 2; tests/examples/test_ros2_nodes.py",
    "surehold grasp rate others": "grasps of another program; tests/cli/test_grasp_rate.py",
    "surehold grasp mug --hand allegro": "the maker's model has to be downloaded",
}


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def commands(text, language):
    lines = "".join(blocks(text, language)).splitlines()
    return [shlex.split(line.removeprefix("$ "), comments=True) for line in lines]


def elsewhere(line):
    return any(" ".join(line).startswith(beginning) for beginning in ELSEWHERE)


def lay(page, folder):
    """Put into the folder what the page says that one has."""
    if page == "README.md":
        import trimesh

        hill = "def quality(x):\n    return -((x[0] - 0.3) ** 2)\n"
        (folder / "rig.py").write_text(hill)
        trimesh.creation.icosphere(subdivisions=2, radius=30.0).export(folder / "part.stl")
    if page in ("README.md", "docs/how-to/ros2.md", "docs/how-to/own-hand.md"):
        models = runpy.run_path(str(ROOT / "tests/grasping/hand_models.py"))
        (folder / "my_hand.urdf").write_text(models["TURNING"])
        (folder / "hand.xml").write_text(models["five_fingers"]())
        if page.endswith("ros2.md"):
            assert run(["hand", "new", "hand.xml"]) == 0
    if page.endswith("synergies.md"):
        shutil.copy(ROOT / "examples/synergies/icub_postures.csv", folder)


def shorter(arguments):
    """Return a command with a dozen trials in place of a hundred."""
    grasps = arguments[0] == "grasp" and arguments[1] != "rate" and "--trials" not in arguments
    return [*arguments, "--trials", "12", "--initial", "10"] if grasps else arguments


def run_commands(name, folder):
    lay(name, folder)
    for program, *arguments in commands(TEXTS[name], "console") + [
        line for line in commands(TEXTS[name], "sh") if line and not elsewhere(line)
    ]:
        assert program == "surehold"
        assert run(shorter(arguments)) == 0, f"`surehold {' '.join(arguments)}` of {name} does not end well"


#: what a page needs that is not in every environment of developers
NEEDED = {"docs/how-to/xopt.md": "gest_api"}
#: pages whose Python reads what their commands write; of the others the commands read what Python writes
COMMANDS_FIRST = {"docs/how-to/own-hand.md"}
RUNNABLE = [
    name
    for name, text in TEXTS.items()
    if ">>>" in text or "```console" in text or any(line and not elsewhere(line) for line in commands(text, "sh"))
]


@pytest.mark.parametrize("name", RUNNABLE)
def test_a_page_runs(name, tmp_path, monkeypatch):
    if name in NEEDED:
        pytest.importorskip(NEEDED[name])
    monkeypatch.chdir(tmp_path)
    session = doctest.DocTestParser().get_doctest(TEXTS[name], {"__name__": "__main__"}, name, name, 0)
    if name in COMMANDS_FIRST:
        run_commands(name, tmp_path)
    results = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(session, clear_globs=False)
    assert results.failed == 0, (
        f"{results.failed} of {results.attempted} examples of {name} differ from what they print"
    )
    if name not in COMMANDS_FIRST:
        run_commands(name, tmp_path)
    for block in blocks(TEXTS[name], "python"):
        if ">>>" not in block:  # goes on with what the session has
            pytest.importorskip(re.search(r"^import (\w+)", block, re.MULTILINE)[1])
            exec(block, session.globs)


@pytest.mark.skipif(not all(map(shutil.which, ("bash", "jq"))), reason="the loop needs bash and jq")
def test_the_loop_of_a_robot_that_touches_runs(tmp_path):
    (loop,) = (block for block in blocks(TEXTS["docs/concepts/unknown-shapes.md"], "text") if "my-robot" in block)
    robot = tmp_path / "my-robot"
    touch = "{value: 0.3, contacts: [{point: [0.04, 0, 0], normal: [1, 0, 0]}]}"
    robot.write_text(f"#!/bin/sh\njq '{touch}' \"$1\"\n")
    robot.chmod(0o755)
    (tmp_path / "surehold").write_text(f'#!/bin/sh\nexec {sys.executable} -m surehold "$@"\n')
    (tmp_path / "surehold").chmod(0o755)
    ended = subprocess.run(
        ["bash", "-euc", loop.replace("seq 20", "seq 2")], cwd=tmp_path, capture_output=True, text=True, timeout=600,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    assert "trial 1: value 0.3" in ended.stdout
    assert "dx = " in ended.stdout


def test_the_commands_for_postgresql(postgresql_server, tmp_path):
    import psycopg

    def start(arguments):
        return subprocess.Popen(
            [sys.executable, "-m", "surehold", *arguments], cwd=tmp_path, stdout=subprocess.PIPE, text=True
        )

    def told(process):
        output, _ = process.communicate(timeout=600)
        assert process.returncode == 0, process.args
        return output

    with psycopg.connect(f"{postgresql_server}/postgres", autocommit=True) as connection:
        connection.execute("CREATE DATABASE trials")
    created, worked = (
        [part.replace("postgresql://user@host", postgresql_server) for part in line[1:]]
        for line in commands(TEXTS["docs/how-to/workers.md"], "sh")
        if "postgresql" in " ".join(line)
    )
    storage = worked[-2:]
    told(start(created))
    told(start(["study", "stop", "crowd", "--trials", "4", *storage]))
    for worker in [start(worked) for _ in range(3)]:
        told(worker)
    assert len(told(start(["study", "export", "crowd", *storage])).splitlines()) == 5  # the first has the names


def test_what_is_run_elsewhere_is_shown_somewhere():
    shown = [" ".join(line) for text in TEXTS.values() for line in commands(text, "sh")]
    for beginning in ELSEWHERE:
        assert any(line.startswith(beginning) for line in shown), f"no page shows {beginning} any more"


def parsed(arguments):
    """Read a command as the command line does, without running it."""
    import typer

    from surehold.cli import completed
    from surehold.cli.application import application

    command, arguments = typer.main.get_command(application()), completed(list(arguments))
    context = command.make_context("surehold", arguments)
    while hasattr(command, "get_command"):
        name, command, arguments = command.resolve_command(context, [*context._protected_args, *context.args])
        context = command.make_context(name, list(arguments), parent=context)
    return context


SHOWN = [
    (name, line)
    for name, text in TEXTS.items()
    for line in commands(text, "sh")
    if "surehold" in line and elsewhere(line) and line[0] != "pip"
]


@pytest.mark.parametrize(("name", "line"), SHOWN, ids=[" ".join(line)[:60] for _, line in SHOWN])
def test_a_command_that_is_not_run_is_one(name, line):
    assert parsed(line[line.index("surehold") + 1 :]).info_name in " ".join(line)


def test_a_wrong_option_is_noticed():
    with pytest.raises(Exception, match="--trails"):
        parsed(["grasp", "mug", "--trails", "3"])


def test_make_targets_and_extras_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    for text in TEXTS.values():
        for target in re.findall(r"`make (\w+)`|^make (\w+)", text, re.MULTILINE):
            assert re.search(rf"^{''.join(target)}:", makefile, re.MULTILINE), target
        for extras in re.findall(r"surehold\[([\w,]+)\]", text):
            for extra in extras.split(","):
                assert re.search(rf"^{extra} = \[", project, re.MULTILINE), extra


def test_yaml_is_a_plan_or_a_hand():
    import yaml

    seen = 0
    for text in TEXTS.values():
        for block in blocks(text, "yaml"):
            if "palm:" in block:
                HandConfig.model_validate(yaml.safe_load(block))
            else:
                assert parse_plan(block, "shown").cells()
            seen += 1
    assert seen >= 2


def test_every_block_is_of_a_kind_that_is_checked():
    for name, text in TEXTS.items():
        opened = re.findall(r"^```(.*)$", text, re.MULTILINE)[::2]
        wrong = {kind for kind in opened if kind not in LANGUAGES and not kind.startswith("{")}
        assert not wrong, f"{name} has blocks of {wrong}"
        for block in blocks(text, "python"):
            assert ">>>" in block or "import xopt" in block, f"{name} shows Python that no test runs"


def test_files_and_benchmarks_that_pages_name_are_there():
    seen = 0
    for name, text in TEXTS.items():
        for path in re.findall(r"`((?:examples|results|tests|packaging)/[\w./-]+)`", text):
            assert (ROOT / path).exists(), f"{name} names {path}"
            seen += 1
        for benchmark in re.findall(r"python -m benchmarks\.([a-z]\w+)", text):
            assert (ROOT / "benchmarks" / f"{benchmark}.py").exists(), f"{name} names the benchmark {benchmark}"
            seen += 1
    assert seen > 20


def test_the_readme_is_short_and_complete():
    text = TEXTS["README.md"]
    assert len(text.splitlines()) <= 120
    assert max(map(len, text.splitlines())) <= 140
    for link in re.findall(r"\]\(([^)]+)\)", text):
        assert (ROOT / link).exists(), f"README links to {link}, which is not there"
