"""Everything that README and site show is executed: Python as doctests, commands as a person would type them.

A page is one session in an empty folder: first its Python, then its `console` blocks, each command of which must end
with 0. Commands of `sh` blocks need a service, a cluster, another package or minutes; they are read by the command line
without being run, so that no option is wrong. Links between pages are checked while the site is built.
"""

import doctest
import re
import shlex
from pathlib import Path

import pytest

from surehold.campaigns.plan_file import parse_plan
from surehold.cli import run
from surehold.grasping.hand.configuration import HandConfig

ROOT = Path(__file__).parents[2]
PAGES = sorted(page for page in (ROOT / "docs").glob("*/*.md") if page.parent.name != "generated")
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *PAGES]}
LANGUAGES = {"python", "console", "sh", "yaml", "text"}


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def commands(text, language):
    lines = "".join(blocks(text, language)).splitlines()
    return [shlex.split(line.removeprefix("$ "), comments=True) for line in lines]


#: what a page needs that is not in every environment of developers
NEEDED = {"docs/how-to/xopt.md": "gest_api"}
RUNNABLE = [name for name, text in TEXTS.items() if ">>>" in text or "```console" in text]


@pytest.mark.parametrize("name", RUNNABLE)
def test_a_page_runs(name, tmp_path, monkeypatch):
    if name in NEEDED:
        pytest.importorskip(NEEDED[name])
    monkeypatch.chdir(tmp_path)
    results = doctest.testfile(str(ROOT / name), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert results.failed == 0, (
        f"{results.failed} of {results.attempted} examples of {name} differ from what they print"
    )
    for program, *arguments in commands(TEXTS[name], "console"):
        assert program == "surehold"
        assert run(arguments) == 0, f"`surehold {' '.join(arguments)}` of {name} does not end well"


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
    if line and "surehold" in line and line[0] not in ("pip", "curl", "createdb")
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


def test_the_readme_is_short_and_complete():
    text = TEXTS["README.md"]
    assert len(text.splitlines()) <= 120
    assert max(map(len, text.splitlines())) <= 140
    for link in re.findall(r"\]\(([^)]+)\)", text):
        assert (ROOT / link).exists(), f"README links to {link}, which is not there"
