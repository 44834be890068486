"""Pages that are made of what the program says of itself: its public names, its changelog, its results."""

import ast
import importlib
import inspect
import json
from pathlib import Path
from typing import Final

import numpy as np

import surehold

SOURCE: Final = Path(surehold.__file__).parent
ROOT: Final = Path(__file__).parents[1]

#: package -> what its page is about
PACKAGES: Final = {
    "surehold": "Optimizer, search space, input noise, models, and whole runs.",
    "surehold.problems": "What is maximized, and how an answer is scored under input noise.",
    "surehold.grasping": "A hand closes on an object; no optimizer is known here.",
    "surehold.studies": "Runs that survive: storage, resume, workers, robots in any language.",
}
#: modules without a stub whose `__all__` is public
MODULES: Final = {"surehold.sklearn": "Estimators for scikit-learn.", "surehold.gest": "A generator of gest-api."}

BENCHMARKS: Final = """# Benchmarks

Made from the tables in `results/`, which hold every run with its trace, settings, versions and seed. All runs were made
on two cores of a virtual x86-64 machine, one process a run and one thread a process; times are CPU seconds. A number
without enough runs behind it says how many it has: 5 of 20.

How long it all takes is on the page of {doc}`speed <speed>`; calibration, closing and quality of grasps:
`python -m benchmarks.NAME`.
"""

SPEED: Final = """# Speed and size

Made from `results/benchmarks/{name}`, which `make bench` stored on {machine}; {load}. Times are CPU seconds of
one core, or wall seconds where several processes work. *Asked* is what each row was meant to take at most: of asks a
share of the time of Optuna's GPSampler and of BoTorch in the same run, of others a fixed time. The *floor* is the least
that has to be done: LAPACK's factorization of the trials' matrix (asks), a copy of the trials in memory (studies), one
look at the distance field (grasps). The yardstick of the machine took {yardstick:.3f} ms (dpotrf of
140 x 140).
"""


PUBLISHED: Final = """# Robust problems of other papers

Sixteen problems on which others have measured robust optimization, with the budgets, initial designs, input noise and
measures of their papers (`sh.problems.robust_problem`); every method with the same initial designs, {count} runs each.
The first two are told of the noise and of the measure, the thesis' UEI and BoTorch of the noise; their answers are best
in the mean. The others know of neither. `surehold campaign run robust-published`; traces, medians and the seeds that
only some methods have: {{doc}}`reproduction </reproduction>`.

Of {count} runs, those whose answer is within 1 % of the best value under the noise:
"""
LOST: Final = """What the answer lacks to the best one, exactly, in the problem's units: mean and standard error.
"""


def public_names(package: str) -> list[str]:
    """Return the public names of a package in the order of its stub, subpackages left out."""
    if package in MODULES:
        return list(importlib.import_module(package).__all__)
    stub = SOURCE.joinpath(*package.split(".")[1:], "__init__.pyi")
    names = [
        alias.asname or alias.name
        for statement in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    ]
    module = importlib.import_module(package)
    top = () if package == "surehold" else public_names("surehold")  # documented there
    return [name for name in names if name not in top and not inspect.ismodule(getattr(module, name))]


def write(folder: Path) -> None:
    """Write all generated pages."""
    folder.mkdir(exist_ok=True)
    for package, about in {**PACKAGES, **MODULES}.items():
        _write(folder / f"{package}.rst", _reference(package, about))
    _write(folder / "benchmarks.md", _benchmarks())
    _write(folder / "speed.md", _speed())
    _write(folder / "published.md", _published())


def _benchmarks() -> str:
    """Return the tables of the campaigns that go past the thesis."""
    from surehold.campaigns.report import read_campaigns
    from surehold.campaigns.sections import campaign_section
    from surehold.campaigns.thesis import exhibit_of
    from surehold.reports.campaign_page import markdown_table

    campaigns = read_campaigns(sorted({path.parent for path in ROOT.glob("results/*/table*.jsonl*")}))
    parts = [BENCHMARKS]
    for plan, records in campaigns.items():
        if exhibit_of(plan) is not None:
            continue
        section = campaign_section(records)
        versions = sorted({tuple(row["versions"].items()) for row in records.done.values()})[-1]
        parts += [f"## {section.title}", section.text, f"Plan `{plan}`.", markdown_table(section.tables[0])]
        parts.append("Made with " + ", ".join(f"{name} {version}" for name, version in versions) + ".")
    return "\n\n".join(part for part in parts if part) + "\n"


def _published() -> str:
    """Return the regrets of the plan `robust-published` on the seeds that all methods have."""
    from surehold.campaigns.plan_file import load_plan
    from surehold.campaigns.report import read_campaigns
    from surehold.problems.named import robust_problem

    plan = load_plan("robust-published")
    done = read_campaigns([ROOT / "results" / plan.name])[plan.name].done.values()
    regrets = {(row["problem"], row["method"], row["seed"]): row["regret"][-1][1] for row in done}
    pairs = {(problem, method) for problem in plan.problems for method in plan.methods}
    seeds = [s for s in range(plan.runs) if all((*pair, s) in regrets for pair in pairs)]
    head = [f"| | {' | '.join(plan.methods)} |", "|---" * (1 + len(plan.methods)) + "|"]
    found, lost = list(head), list(head)
    for problem, on in plan.problems.items():
        enough = 0.01 * abs(robust_problem(on.function).optimum.value)
        rows = [np.array([regrets[problem, method, s] for s in seeds]) for method in plan.methods]
        found.append(f"| {problem} | {' | '.join(str(np.sum(row <= enough)) for row in rows)} |")
        lost.append(f"| {problem} | {' | '.join(_with_error(row) for row in rows)} |")
    seconds = [
        np.mean([row["cpu_seconds"] for row in done if row["method"] == method and row["seed"] in seeds])
        for method in plan.methods
    ]
    found.append(f"| CPU s a run | {' | '.join(f'{value:.2g}' for value in seconds)} |")
    return "\n".join([PUBLISHED.format(count=len(seeds)), *found, "", LOST, *lost]) + "\n"


def _with_error(values: np.ndarray) -> str:
    """Return the mean of values (n,) and its standard error in two digits."""
    both = values.mean(), values.std(ddof=1) / len(values) ** 0.5
    mean, error = (f"{float(f'{value:.2g}'):.10g}" for value in both)
    return f"{mean} ({error})"


def _speed() -> str:
    """Return the last table of `make bench`."""
    path = max(ROOT.glob("results/benchmarks/*.json"))
    stored = json.loads(path.read_text(encoding="utf-8"))
    load = f"the load at its start was {stored['load']:.1f}"
    text = SPEED.format(name=path.name, machine=stored["machine"], load=load, yardstick=1e3 * stored["yardstick"])
    lines = ["| | seconds | times asked | times the floor | MB |", "|---|---|---|---|---|"]
    for name, row in stored["rows"].items():
        ratios = [f"{row['seconds'] / row[limit]:.3g}" if limit in row else "" for limit in ("asked", "floor")]
        held = f"{row['megabytes']:.0f}" if "megabytes" in row else ""
        lines.append(f"| {name} | {row['seconds']:.4g} | {' | '.join(ratios)} | {held} |")
    return "\n".join([text, *lines]) + "\n"


def _reference(package: str, about: str) -> str:
    module = importlib.import_module(package)
    groups: dict[str, list[str]] = {"Classes": [], "Functions": [], "Errors": [], "Constants": []}
    for name in public_names(package):
        value = getattr(module, name)
        if inspect.isclass(value):
            kind = "Errors" if issubclass(value, Exception) else "Classes"
        else:
            kind = "Functions" if callable(value) else "Constants"
        groups[kind].append(name)
    parts = [package, "=" * len(package), "", about, "", f".. currentmodule:: {package}", ""]
    for title, names in groups.items():
        if names and title == "Constants":
            parts += [title, "-" * len(title), ""]
            for name in names:
                value = getattr(module, name)
                shown = ", ".join(f"``{item}``" for item in value)
                parts += [f"``{name}``", f"    {shown}", ""]
        elif names:
            parts += [title, "-" * len(title), "", ".. autosummary::", "    :toctree: names", "    :nosignatures:", ""]
            parts += [*(f"    {name}" for name in names), ""]
    return "\n".join(parts)


def _write(path: Path, text: str) -> None:
    """Write a page where it has changed, so that Sphinx reads it anew only then."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
