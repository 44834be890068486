"""An optimizer as a JSON file: its settings and its trials. Inputs are stored in the unit cube, to the last bit."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.box import Box
from surehold.optimization.constraints.linear import Linear
from surehold.optimization.known_coordinates import Fixed, fixed_of
from surehold.optimization.limits import limits_of
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.trials import Trials
from surehold.store.atomic import write_file

__all__ = ["read", "write"]

_FORMAT: Final = "surehold optimizer"
_VERSION: Final = 1
_NAMED_BY_USERS: Final = ("constraints", "fixed", "guess")  # settings {name: value}: no name is a word of the file
_OBJECT: Final = "object that is not stored"


def write(path: str | os.PathLike[str], box: Box, settings: Mapping[str, Any], trials: Trials) -> None:
    """Write settings, arguments of `Optimizer`, and trials; a file that is there is replaced as a whole.

    Settings that are objects (a surrogate, a lattice, noise that varies) are named only. Raises InputError where the
    file cannot be written.
    """
    data = {
        "format": _FORMAT,
        "version": _VERSION,
        "box": {variable.name: list(variable.described) for variable in box.variables},
        **({} if box.uncontrolled is None else {"uncontrolled": _conditions(box)}),
        "settings": {name: _plain(value) for name, value in settings.items()},
        "trials": [
            {
                "number": int(number),
                "commanded": commanded.tolist(),
                "reached": reached.tolist(),
                "value": None if np.isnan(value) else float(value),
                **({"executions": of} if of != 1 else {}),
                **({"noise": deviation} if deviation else {}),
                **({"outputs": [None if np.isnan(v) else v for v in outputs]} if outputs else {}),
            }
            for number, commanded, reached, value, outputs, of, deviation in zip(
                trials.numbers,
                trials.commanded,
                trials.reached,
                trials.values,
                trials.outputs.tolist(),
                trials.executions.tolist(),
                trials.deviations.tolist(),
                strict=True,
            )
        ],
        **({"preferences": trials.pairs.tolist()} if len(trials.pairs) else {}),
        "pending": [
            {"number": number, "commanded": u.tolist()}
            for number, u in zip(trials.pending_numbers, trials.pending, strict=True)
        ],
    }
    write_file(Path(path), json.dumps(data, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str], given: Mapping[str, Any]) -> tuple[Box, dict[str, Any], Trials]:
    """Return the box, the settings, those `given` in place of stored ones, and the trials that a file holds.

    Where other `constraints` are given the outputs stay those of their names: one that is new was not measured, one
    that is left out is dropped. Where the other `direction` is given values stay as they were told. Where other `fixed`
    values are given initial points at others are dropped.

    Raises
    ------
    InputError
        If the file cannot be read, was not written by `write` or by a newer version, or names an object that is not
        given.
    """
    shown = repr(os.fspath(path))
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"file {shown} cannot be read: {error.strerror or error}.") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"file {shown} is no JSON: {error}.") from None
    if not isinstance(data, dict) or data.get("format") != _FORMAT:
        raise InputError(f"file {shown} holds no optimizer; give one that Optimizer.save has written.")
    if data.get("version") != _VERSION:
        raise InputError(f"file {shown} has the format {data.get('version')!r}, this version reads {_VERSION}.")
    try:
        conditions = data.get("uncontrolled")
        given_conditions = None if conditions is None else {tuple(conditions["names"]): conditions["samples"]}
        box = Box(data["box"], uncontrolled=given_conditions)
        settings = {name: _restored(name, value) for name, value in {**data["settings"], **given}.items()}
        constant = fixed_of(box, settings.get("fixed"))
        if "fixed" in given and constant is not None and "initial_points" not in given:
            settings["initial_points"] = _still_tried(box, constant, settings.get("initial_points"))
        told, pending = data["trials"], data["pending"]
        limits, stored = limits_of(settings.get("constraints")), list(data["settings"].get("constraints") or ())
        columns = [stored.index(limit.name) if limit.name in stored else len(stored) for limit in limits]
        outputs = [[*trial.get("outputs", [np.nan] * len(stored)), np.nan] for trial in told]
        if any(len(row) != len(stored) + 1 for row in outputs):
            raise ValueError("a trial has more or fewer outputs than there are constraints")
        # What is stored is in the sign in which it is maximized.
        same = settings.get("direction", "maximize") == data["settings"].get("direction", "maximize")
        sign = 1.0 if same else -1.0
        trials = Trials(box, limits, settings.get("outcome", "value") != "value", constant)
        trials.restore_cube(
            [trial["commanded"] for trial in told],
            [np.nan if trial["value"] is None else sign * trial["value"] for trial in told],
            [trial["reached"] for trial in told],
            [trial["commanded"] for trial in pending],
            [trial["number"] for trial in [*told, *pending]],
            np.array([[row[k] for k in columns] for row in outputs], dtype=np.float64).reshape(len(told), len(limits)),
            np.array([trial.get("executions", 1) for trial in told], dtype=np.intp),
            np.array([trial.get("noise", 0.0) for trial in told], dtype=np.float64),
            data.get("preferences", ()),
        )
        inputs = np.concatenate([trials.commanded, trials.pending])
        if not (np.isfinite(trials.reached).all() and np.all((inputs >= 0.0) & (inputs <= 1.0))):
            raise ValueError("an input lies outside of the box")
    except InputError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise InputError(f"file {shown} is damaged: {type(error).__name__}: {error}.") from None
    return box, settings, trials


def _conditions(box: Box) -> dict[str, Any]:
    """Return the samples of uncontrolled variables, in the box's units."""
    held = box.uncontrolled
    if held is None:
        return {}
    names = [name for name, taken in zip(box.names, held.held, strict=True) if taken]
    return {"names": names, "samples": held.values.tolist()}


def _still_tried(box: Box, fixed: Fixed, points: Any) -> Any:
    """Return the initial points at the values of variables that were fixed later; those at others are not asked for."""
    kept = [] if points is None else [point for point in points if fixed.keeps(box.to_unit([point]), exactly=True)[0]]
    return kept or None


def _plain(value: Any) -> Any:
    if isinstance(value, InputNoise) and not value.varies:
        return {"input noise": value.to_json()}
    if isinstance(value, Risk):
        return {"risk": _plain(asdict(value))}
    if isinstance(value, Linear):
        return {"linear": asdict(value)}
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    return value if value is None or isinstance(value, (str, bool, int, float)) else {_OBJECT: repr(value)}


def _restored(name: str, value: Any) -> Any:
    if name in _NAMED_BY_USERS or not isinstance(value, (dict, list)):
        return value
    if isinstance(value, list):
        return [_restored(name, entry) for entry in value] if name == "allowed" else value
    if _OBJECT in value:
        raise InputError(
            f"{name} was {value[_OBJECT]}, which a file does not hold; say Optimizer.load(path, {name}=...)."
        )
    if "input noise" in value:
        return InputNoise.from_json(value["input noise"])
    if "risk" in value:
        return Risk(**value["risk"])
    if "linear" in value:
        return Linear(**value["linear"])
    return value
