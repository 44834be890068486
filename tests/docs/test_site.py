"""What the site says of the program is so: names, oracles, numbers of the README's picture."""

import importlib.util
import json
import re
import tomllib
from pathlib import Path

import pytest

import surehold as sh
from surehold.campaigns.table import read_folder

ROOT = Path(__file__).parents[2]


def module(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def test_every_public_name_has_its_entry(tmp_path):
    pages = module("pages")
    pages.write(tmp_path)
    for package in ("surehold.grasping", "surehold.problems", "surehold.studies"):
        text = (tmp_path / f"{package}.rst").read_text()
        names = set(importlib.import_module(package).__all__) - set(sh.__all__)
        for name in names:
            assert re.search(rf"^    {name}$|^``{name}``$", text, re.MULTILINE), f"{package}.{name} has no entry"
    top = (tmp_path / "surehold.rst").read_text()
    for name in set(sh.__all__) - {"grasping", "problems"}:
        assert re.search(rf"^    {name}$", top, re.MULTILINE), f"{name} has no entry"


def test_benchmarks_are_of_the_results(tmp_path):
    pages = module("pages")
    pages.write(tmp_path)
    text = (tmp_path / "benchmarks.md").read_text()
    assert "| RKHS | surehold robust | mean under input noise |" in text
    assert "Made with surehold" in text
    stored = json.loads(max(ROOT.glob("results/benchmarks/*.json")).read_text())
    name, row = next((name, row) for name, row in stored["rows"].items() if "asked" in row)
    speed = (tmp_path / "speed.md").read_text()
    assert f"| {name} | {row['seconds']:.4g} | {row['seconds'] / row['asked']:.3g} |" in speed


def test_the_readme_counts_the_published_problems():
    records = read_folder(ROOT / "results" / "robust-published")
    regrets = {}
    for (problem, method, seed), row in records.done.items():
        regrets.setdefault(problem, {}).setdefault(method, {})[seed] = row["regret"][-1][1]
    common = set.intersection(*(set(found) for methods in regrets.values() for found in methods.values()))
    means = {p: {m: sum(found[s] for s in common) for m, found in methods.items()} for p, methods in regrets.items()}
    lowest = sum(min(found, key=found.get) == "surehold robust" for found in means.values())
    assert {len(found) for found in means.values()} == {8}
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = f"robust problems of other papers the lowest mean regret of eight methods, {len(common)} seeds"
    assert f"{lowest} of {len(means)} {said}" in text


def rows_of_validation():
    text = (ROOT / "docs/results/validation.md").read_text(encoding="utf-8")
    return re.findall(r"^\| (.+?) \| (.+?) \| `(tests/.+?)` \|$", text, re.MULTILINE)


@pytest.mark.parametrize(("what", "oracle", "path"), rows_of_validation())
def test_an_oracle_is_used_where_it_is_said(what, oracle, path):
    words = (
        "scipy",
        "mpmath",
        "linprog",
        "filterpy",
        "sklearn",
        "nlopt",
        "coal",
        "ConvexHull",
        "trimesh",
        "statsmodels",
        "xopt",
        "mujoco",
    )
    named = [word for word in words if word.lower() in oracle.lower()]
    source = (ROOT / path).read_text(encoding="utf-8")
    assert named, f"no known oracle is named for {what}"
    for word in named:
        assert word.lower() in source.lower(), f"{path} does not use {word}"


def test_the_readme_tells_the_numbers_of_its_picture():
    numbers = json.loads((ROOT / "docs/mug.json").read_text())["candidates"]
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for label in ("highest observed", "recommended"):
        for field in ("quality", "mean"):
            assert f"{numbers[label][field]:.3f}" in text, f"README lacks the {field} of the {label} grasp"


def test_the_picture_is_of_the_program_as_it_is(tmp_path):
    pictures = module("pictures")
    stored = json.loads((ROOT / "docs/mug.json").read_text())
    found = pictures.run(tmp_path / "run")
    assert found["surehold"] == stored["surehold"], "run `make pictures` and look at docs/mug.png"
    for label, then in stored["candidates"].items():
        now = found["candidates"][label]
        for field, tolerance in (("quality", 0.02), ("mean", 0.04)):
            assert now[field] == pytest.approx(then[field], abs=tolerance), (
                "run `make pictures` and look at docs/mug.png"
            )


def test_the_version_is_the_same_everywhere():
    for path, pattern in (
        ("pyproject.toml", r'^version = "(.+)"$'),
        ("CITATION.cff", r"^version: (.+)$"),
        ("docs/about/cite.md", r"version = \{(.+)\}"),
        ("packaging/conda/recipe.yaml", r'version: "(.+)"'),
        ("examples/ros2/surehold_ros/setup.py", r'version="(.+)"'),
        ("examples/ros2/surehold_ros/package.xml", r"<version>(.+)</version>"),
        ("examples/ros2/surehold_interfaces/package.xml", r"<version>(.+)</version>"),
        ("CHANGELOG.md", r"^## ([\d.]+) "),
    ):
        found = re.search(pattern, (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE)
        assert found is not None, path
        assert found[1] == sh.__version__, f"{path} has version {found[1]}"


RECIPE = ROOT / "packaging/conda/recipe.yaml"


def test_the_conda_recipe_asks_for_what_the_wheel_does():
    import yaml

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [
        *project["dependencies"],
        *(one for extra in ("campaign", "cli", "grasp", "report") for one in extras[extra]),
    ]
    asked = {one.lower().replace("matplotlib", "matplotlib-base") for one in asked if not one.startswith("surehold")}
    recipe = yaml.safe_load(RECIPE.read_text(encoding="utf-8"))
    assert {one.replace(" ", "") for one in recipe["requirements"]["run"][1:]} == asked


def test_the_conda_recipe_renders():
    rattler_build = pytest.importorskip("rattler_build")
    (variant,) = rattler_build.Stage0Recipe.from_file(str(RECIPE)).render(rattler_build.VariantConfig())
    assert variant.recipe.package.version == sh.__version__
