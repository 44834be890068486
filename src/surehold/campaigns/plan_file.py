"""Plans by name and from files: the shipped ones, YAML of the same form, and Python functions that return a `Plan`.

A YAML plan may say `extends: NAME` of a shipped plan: what it gives is merged into that one, key by key; a key given as
null is taken away.
"""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, Literal

from surehold.campaigns.methods import METHODS, checked_settings
from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup
from surehold.campaigns.problem_setup import checked_problem
from surehold.errors import InputError, unknown_name

__all__ = ["load_plan", "parse_plan", "shipped_plans"]

_LONGEST, _LARGEST = 100_000, 100_000  # characters and values of a plan; the shipped ones have a hundredth
_PLANS: Final = files("surehold.campaigns") / "plans"


def shipped_plans() -> list[str]:
    """Return the names of the plans that come with surehold."""
    return sorted(entry.name.removesuffix(".yaml") for entry in _PLANS.iterdir() if entry.name.endswith(".yaml"))


def load_plan(reference: str) -> Plan:
    """Return a shipped plan by NAME, the plan of a YAML file, or what `path/file.py:function` returns.

    Raises
    ------
    InputError
        For an unknown name, problem, method, setting or key, with the nearest valid one; for a file that is missing or
        no plan.
    """
    place, colon, _ = reference.rpartition(":")
    if colon and place.endswith(".py"):
        from surehold.problems.function import load_function

        make: Any = load_function(reference)
        try:
            plan = make()
        except InputError:
            raise
        except Exception as error:  # whatever a user's function raises is told as bad input
            raise InputError(f"{reference} raised {type(error).__name__}: {error}") from error
        if not isinstance(plan, Plan):
            raise InputError(f"{reference} returned a {type(plan).__name__}; return a surehold.campaigns.plan.Plan.")
        return _checked(plan)
    if reference.endswith((".yaml", ".yml")):
        path = Path(reference)
        if path.exists() and not path.is_file():  # a pipe or a device may never end
            raise InputError(f"plan file '{path}' is no file; give a file of YAML.")
        try:
            with open(path, encoding="utf-8") as file:
                text = file.read(_LONGEST + 1)
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"plan file '{path}' cannot be read ({getattr(error, 'strerror', error)}).") from None
        return parse_plan(text, path.stem)
    if reference not in shipped_plans():
        raise unknown_name("plan", reference, [*shipped_plans(), "FILE.yaml", "FILE.py:FUNCTION"])
    return parse_plan((_PLANS / f"{reference}.yaml").read_text(encoding="utf-8"), reference)


def parse_plan(text: str, name: str) -> Plan:
    """Return the plan written in YAML.

    Raises
    ------
    InputError
        As `load_plan`.
    """
    return _checked(_plan_of(_document(text, name), name))


def _document(text: str, name: str) -> dict[str, Any]:
    import yaml

    if len(text) > _LONGEST:
        raise InputError(f"plan '{name}' is longer than {_LONGEST:,} characters; split it.")
    try:
        _check_keys(yaml.compose(text, yaml.SafeLoader), name)
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # ValueError: a date or a number that is none
        raise InputError(f"plan '{name}' is no YAML: {' '.join(str(error).split())[:300]}") from None
    except RecursionError:
        raise InputError(f"plan '{name}' is nested too deeply; a plan has five levels.") from None
    _check_size(document, name)
    if document is None:
        raise InputError(f"plan '{name}' is empty; give title, problems and methods.")
    if not isinstance(document, dict):
        raise InputError(f"plan '{name}' is {type(document).__name__}; give title, problems and methods.")
    base = document.pop("extends", None)
    if base is None:
        return document
    if base not in shipped_plans():
        raise unknown_name(f"plan that '{name}' extends", base, shipped_plans())
    return _merged(_document((_PLANS / f"{base}.yaml").read_text(encoding="utf-8"), base), document)


def _check_keys(root: Any, name: str) -> None:
    """Raise InputError where a mapping has one key twice, of which YAML keeps the last without a word."""
    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(getattr(node, "value", None), list):
            continue
        seen.add(id(node))  # an alias may make a document endless
        pairs = [part for part in node.value if isinstance(part, tuple)]
        first: dict[str, Any] = {}
        for key, value in pairs:
            if isinstance(key.value, str) and key.value != "<<" and first.setdefault(key.value, key) is not key:
                lines = first[key.value].start_mark.line + 1, key.start_mark.line + 1
                raise InputError(f"plan '{name}' has '{key.value}' in lines {lines[0]} and {lines[1]}; give it once.")
            waiting += [key, value]
        waiting += [] if pairs else node.value


def _check_size(document: Any, name: str) -> None:
    """Raise InputError where a document is no tree of a plan's size: its aliases (*name) may make it endless."""
    waiting, values = [document], 0
    while waiting:
        value = waiting.pop()
        values += 1
        if values > _LARGEST:
            raise InputError(
                f"plan '{name}' holds more than {_LARGEST:,} values with its aliases; write a smaller one."
            )
        if isinstance(value, dict):
            waiting += [*value, *value.values()]
        elif isinstance(value, list | tuple | set):
            waiting += value
        elif isinstance(value, str) and not value.isascii():
            try:
                value.encode()
            except UnicodeEncodeError:
                raise InputError(f"plan '{name}' holds the text {value[:60]!r}, which is no Unicode.") from None
        elif isinstance(value, int) and abs(value) > 1e300:
            raise InputError(f"plan '{name}' holds a whole number of {value.bit_length()} bits; give a smaller one.")


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        if value is None:
            result.pop(key, None)
        elif isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = _merged(result[key], value)
        else:
            result[key] = value
    return result


def _plan_of(document: dict[str, Any], name: str) -> Plan:
    """Check form and types with pydantic; say what is wrong in the project's own words."""
    from pydantic import BaseModel, ConfigDict, ValidationError

    strict = ConfigDict(extra="forbid", strict=True)

    class Problem(BaseModel):
        model_config = strict
        function: str
        trials: int
        initial: int
        arguments: dict[str, Any] = {}
        input_noise: float | Literal["own"] | None = None
        requeries: int = 100
        observation_noise: float = 0.0
        settings: dict[str, Any] = {}

    class Method(BaseModel):
        model_config = ConfigDict(extra="allow", strict=True)  # all other keys are settings
        optimizer: str = "surehold"
        robust: bool = False

    class Document(BaseModel):
        model_config = strict
        title: str
        problems: dict[str, Problem]
        methods: dict[str, Method]
        runs: int = 30
        note: str = ""

    try:
        told = Document.model_validate(document)
    except ValidationError as error:
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")  # a misspelt key is missing, too
        raise _explained(first, name, {"": Document, "problems": Problem, "methods": Method}) from None
    return Plan(
        name,
        told.title,
        {label: ProblemSetup(**problem.model_dump()) for label, problem in told.problems.items()},
        {label: MethodSetup(m.optimizer, m.robust, dict(m.model_extra or {})) for label, m in told.methods.items()},
        told.runs,
        told.note,
    )


def _explained(problem: Mapping[str, Any], name: str, models: Mapping[str, Any]) -> InputError:
    *parents, last = (str(part) for part in problem["loc"])
    where = f"plan '{name}'" + "".join(f", {part}" for part in parents)
    if problem["type"] == "extra_forbidden":
        return unknown_name(f"key of {where}:", last, models[parents[0] if parents else ""].model_fields)
    if problem["type"] == "missing":
        return InputError(f"{where}: '{last}' is missing; give it.")
    given = str(problem.get("input"))[:60]
    if last == "[key]":
        where = f"plan '{name}', {parents[0]}"
        return InputError(f"{where}: the label {given} is no text; write it in quotes.")
    if problem["type"] == "model_type":
        return InputError(f"{where}: {last} is {given!r}; give its settings, {{NAME: VALUE, ...}}.")
    return InputError(f"{where}: {last} is {given!r}; {problem['msg'][0].lower()}{problem['msg'][1:]}.")


def _checked(plan: Plan) -> Plan:
    for label, by in plan.methods.items():
        if by.optimizer not in METHODS:
            raise unknown_name(f"optimizer of method '{label}'", by.optimizer, METHODS)
        checked_settings(f"method '{label}'", by.optimizer, by.settings, by.robust)
    for label, on in plan.problems.items():
        checked_settings(f"problem '{label}'", "surehold", on.settings, on.input_noise is not None)
        checked_problem(label, on)
    return plan
