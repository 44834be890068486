"""The constants that decide an ask: each is explained, names what measured it, and is used."""

import ast
import re
from pathlib import Path

import pytest

import surehold
from surehold import defaults

SOURCE = Path(defaults.__file__).read_text(encoding="utf-8")
PACKAGE = Path(surehold.__file__).parent
ROOT = Path(__file__).parents[1]
#: comment and names of each block of constants
BLOCKS = re.findall(r"((?:^#: .*\n)+)((?:^[A-Z_]+: Final = .*\n)+)", SOURCE, flags=re.MULTILINE)
NAMES = [name for name in vars(defaults) if name.isupper()]


def test_every_constant_is_explained():
    explained = [name for _, block in BLOCKS for name in re.findall(r"^([A-Z_]+):", block, flags=re.MULTILINE)]
    assert explained == NAMES


@pytest.mark.parametrize(("comment", "names"), BLOCKS, ids=[names.split(":")[0] for _, names in BLOCKS])
def test_each_says_what_measured_it(comment, names):
    words = re.sub(r"\s*\n#: ", " ", comment)
    benchmarks = re.findall(r"python -m benchmarks\.(\w+)", words)
    campaigns = re.findall(r"surehold campaign run ([\w.-]+)", words)
    assert benchmarks or campaigns or re.search(r"never measured", words, flags=re.IGNORECASE), words
    for name in benchmarks:
        assert (ROOT / "benchmarks" / f"{name}.py").exists(), f"there is no benchmark {name}"
    for name in campaigns:
        plan = PACKAGE / "campaigns" / "plans" / f"{name.rstrip('.')}.yaml"
        assert plan.exists(), f"there is no campaign {name}"


def test_every_constant_is_used():
    used = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module == "surehold.defaults":
                used |= {alias.name for alias in node.names}
    assert used == set(NAMES)


def test_imports_nothing_of_surehold():
    modules = {node.module for node in ast.walk(ast.parse(SOURCE)) if isinstance(node, ast.ImportFrom)}
    assert modules <= {"math", "typing"}
