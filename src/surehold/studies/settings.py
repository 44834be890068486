"""What a study is: its parameters, their units and noise, the optimizer's settings, and the problem it is about.

Written into the study when it is created; whoever opens the study later works with what is written there.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any, Final

import numpy as np
from optuna.study import Study

from surehold.errors import InputError, unknown_name
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.problems.grasp.options import checked_words
from surehold.studies.sampler import Sampler
from surehold.studies.search_space import SearchSpace

__all__ = ["SETTINGS", "StudySettings"]

#: Study attribute that holds the settings.
SETTINGS: Final = "surehold:settings"
_VERSION: Final = 1
#: Options of a grasp that name a file, where they have a suffix.
_FILES: Final = ("object", "cloud", "contacts", "hand", "hand_config", "preshape")


@dataclass(frozen=True)
class StudySettings:
    """What a study is."""

    space: SearchSpace
    input_noise: InputNoise | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    """unit of each parameter by name, such as {"dx": "m"}; those without one are left out"""
    optimizer: Mapping[str, Any] = field(default_factory=dict)
    """further settings of `Sampler`: seed, surrogate, criterion, n_initial, risk, ...; plain data, or a `Risk`"""
    problem: Mapping[str, Any] = field(default_factory=dict)
    """what a worker tries, as plain data; empty where a robot makes the trials. Paths of files become absolute, so that
    workers find them from any folder"""
    direction: str = "maximize"
    """of the values: "maximize" or "minimize"."""

    def __post_init__(self) -> None:
        if self.direction not in ("maximize", "minimize"):
            raise unknown_name("direction", self.direction, ("maximize", "minimize"))
        if self.direction == "minimize" and self.optimizer.get("outcome", "value") != "value":
            raise InputError("direction='minimize' is of values; where trials succeed or fail, success is maximized.")
        object.__setattr__(self, "problem", _found_from_anywhere(self.problem))
        if isinstance(self.optimizer.get("risk"), str):  # a name, which is a measure with its usual parameter
            object.__setattr__(self, "optimizer", {**self.optimizer, "risk": Risk(self.optimizer["risk"])})
        known = [name for name in signature(Optimizer).parameters if name not in ("box", "direction", "input_noise")]
        for name in self.optimizer:
            if name not in known:
                raise unknown_name("setting of an optimizer", name, known)
        _noise_to_json(self.input_noise, self.space)
        for name in self.units:
            if name not in self.space.distributions:
                raise InputError(
                    f"unit given for '{name}', which is no parameter; they are {', '.join(self.space.distributions)}."
                )
        self.sampler()

    def sampler(self) -> Sampler:
        """Return a sampler with these settings; raises InputError where they are wrong."""
        return Sampler(self.space, input_noise=self.input_noise, **self.optimizer)

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        optimizer = {key: asdict(v) if isinstance(v, Risk) else v for key, v in self.optimizer.items()}
        return {
            "version": _VERSION,
            "parameters": self.space.to_json(),
            "input_noise": _noise_to_json(self.input_noise, self.space),
            "units": dict(self.units),
            "optimizer": {"seed": 0, **optimizer},
            "problem": dict(self.problem),
            "direction": self.direction,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "StudySettings":
        """Return the settings that `to_json` described.

        Raises
        ------
        InputError
            If they were written by a newer version of surehold.
        """
        version = data.get("version", 0)
        if not isinstance(version, int) or version > _VERSION:
            raise InputError(f"the study was written by a newer version of surehold (format {version}); install that.")
        space = SearchSpace.from_json(data["parameters"])
        optimizer = {k: Risk(**v) if k == "risk" and isinstance(v, dict) else v for k, v in data["optimizer"].items()}
        noise = _noise_from_json(data["input_noise"])
        direction = data.get("direction", "maximize")  # studies before 0.2 say nothing, and maximize
        return cls(space, noise, data["units"], optimizer, data.get("problem", {}), direction)

    @classmethod
    def of(cls, study: Study) -> "StudySettings":
        """Return the settings written into a study; raises InputError where there are none."""
        data = study.user_attrs.get(SETTINGS)
        if not isinstance(data, dict):
            raise InputError(
                f"study '{study.study_name}' was not created by surehold; create one of another name, and take its "
                "trials over with: surehold study import."
            )
        try:
            return cls.from_json(data)
        except InputError:
            raise
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
            raise InputError(
                f"the settings of study '{study.study_name}' are damaged ({type(error).__name__}: {error}); restore "
                "the storage from a copy."
            ) from None

    def differences(self, other: "StudySettings") -> list[str]:
        """Return in words what `other` wants differently, empty where they agree."""
        mine, theirs = self.to_json(), other.to_json()
        found = []
        for part, name in (("parameters", "parameter"), ("units", "unit of"), ("optimizer", ""), ("problem", "")):
            for key in mine[part] | theirs[part]:
                ours, asked = (side[part].get(key) for side in (mine, theirs))
                if key == "grasp" and ours and asked:
                    # Options that an earlier version did not know are at their defaults.
                    ours, asked = checked_words(ours), checked_words(asked)
                if part == "problem" and isinstance(ours, dict) and isinstance(asked, dict):
                    differing = [k for k in ours | asked if not _same(ours.get(k), asked.get(k))]
                    ours, asked = ({k: side.get(k) for k in differing} for side in (ours, asked))
                if key == "risk":
                    ours, asked = (str(side.optimizer.get(key, Risk())) for side in (self, other))
                if ours != asked and not (part == "problem" and _same(ours, asked)):
                    found.append(f"{name} {key}: {_short(ours)} in the study, {_short(asked)} now".strip())
        names, asked = (list(side["parameters"]) for side in (mine, theirs))
        if names != asked and set(names) == set(asked):  # a function that takes an array tells them by their places
            found.append(f"order of the parameters: {', '.join(names)} in the study, {', '.join(asked)} now")
        if self.direction != other.direction:
            found.append(f"direction: {self.direction} in the study, {other.direction} now")
        if mine["input_noise"] != theirs["input_noise"]:
            found.append(
                f"input noise: {_short(mine['input_noise'])} in the study, {_short(theirs['input_noise'])} now"
            )
        return found


def _found_from_anywhere(problem: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description of a problem with absolute paths."""
    found = dict(problem)
    place, _, name = str(found.get("function", "")).rpartition(":")
    if place.endswith(".py"):
        found["function"] = f"{Path(place).resolve()}:{name}"
    for kind in ("grasp", "touch"):
        words = dict(found.get(kind, {}))
        for option in _FILES:
            if Path(words.get(option) or "").suffix:
                words[option] = str(Path(words[option]).resolve())
        found |= {kind: words} if words else {}
    return found


def _same(ours: Any, asked: Any) -> bool:
    """Tell whether two words of a problem say the same: one may name a file by where it was before it was moved."""
    if ours == asked or not (isinstance(ours, str) and isinstance(asked, str)):
        return bool(ours == asked)
    (mine, _, function), (theirs, _, other) = (text.partition(".py:") for text in (ours, asked))
    before, now = Path(mine + ".py" * bool(function)), Path(theirs + ".py" * bool(other))
    return before.is_absolute() and (before.name, function) == (now.name, other) and not before.exists()


def _short(value: Any) -> str:
    """Return a setting as a message shows it."""
    if isinstance(value, dict) and "attributes" in value:
        attributes = value["attributes"]
        if "choices" in attributes:
            return "|".join(map(str, attributes["choices"]))
        kind = [k for k in ("log", "step") if attributes.get(k)]
        return f"{attributes['low']:g}:{attributes['high']:g}{' ' if kind else ''}{' '.join(kind)}"
    return "nothing" if value is None else str(value)


def _noise_to_json(noise: InputNoise | None, space: SearchSpace) -> dict[str, Any] | None:
    """Return standard deviations or half-widths by name, or a covariance in the order of the numbers."""
    numbers = None if space.box is None else space.box.numbers
    if noise is None or numbers is None:
        return None
    if noise.varies:
        raise InputError(
            "input noise that differs from place to place is a function, which cannot be stored with a study; give "
            "standard deviations, half-widths or a covariance, or use surehold.Sampler directly."
        )
    if "samples" in (stored := noise.to_json()):
        return stored
    covariance = noise.unit_covariance(numbers)
    deviations = np.sqrt(np.diag(covariance)) * numbers.widths
    if np.array_equal(covariance, np.diag(np.diag(covariance))):
        rounded = [float(f"{deviation:.14g}") for deviation in deviations]  # 0.003, not 0.0029999999999999996
        if noise.bounded:
            return {
                "half_widths": {n: float(f"{3.0**0.5 * r:.13g}") for n, r in zip(numbers.names, rounded, strict=True)}
            }
        return {"standard_deviations": dict(zip(numbers.names, rounded, strict=True))}
    return {"covariance": (covariance * np.outer(numbers.widths, numbers.widths)).tolist()}


def _noise_from_json(data: Mapping[str, Any] | None) -> InputNoise | None:
    if data is None:
        return None
    if "covariance" in data:
        return InputNoise(covariance=data["covariance"])
    if "samples" in data:
        return InputNoise.samples(data["samples"])
    if "half_widths" in data:
        return InputNoise.uniform(data["half_widths"])
    return InputNoise(data["standard_deviations"])
