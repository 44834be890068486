"""One run that survives: storage, resume, workers, and trials made by a robot. Stands on Optuna."""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.studies.recommendation import StudyRecommendation, recommend
    from surehold.studies.robot import Asked, NothingToAsk, RobotStudy
    from surehold.studies.sampler import Sampler
    from surehold.studies.search_space import SearchSpace
    from surehold.studies.settings import StudySettings
    from surehold.studies.stop_rule import StopRule

from surehold.errors import InputError


class _OptunaMissing(InputError, ImportError):
    pass


if find_spec("optuna") is None:
    raise _OptunaMissing("studies stand on Optuna, which is not installed; pip install 'surehold[study]' does it.")

__all__ = [
    "Asked",
    "NothingToAsk",
    "RobotStudy",
    "Sampler",
    "SearchSpace",
    "StopRule",
    "StudyRecommendation",
    "StudySettings",
    "recommend",
]

_HOMES = {
    "Asked": "robot",
    "NothingToAsk": "robot",
    "RobotStudy": "robot",
    "Sampler": "sampler",
    "SearchSpace": "search_space",
    "StopRule": "stop_rule",
    "StudyRecommendation": "recommendation",
    "StudySettings": "settings",
    "recommend": "recommendation",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
