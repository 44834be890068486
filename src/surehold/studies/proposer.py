"""What the child process does that makes proposals ahead (`prepared`): one optimizer, one proposal after the other."""

import signal
from collections.abc import Mapping
from typing import Any

import numpy as np

from surehold.optimization.optimizer import Optimizer
from surehold.store.parent import end_with
from surehold.studies.history import History
from surehold.studies.sampler import Sampler
from surehold.studies.settings import StudySettings

__all__ = ["begin", "propose", "take_up"]

_study: tuple[StudySettings, Sampler] | None = None
_optimizer: Optimizer | None = None
_made: dict[int, dict[str, Any]] = {}  # parameters of proposals by the number of their trial


def begin(settings: Mapping[str, Any], parent: int) -> None:
    """Be ready for the study with these settings (`StudySettings.to_json`); end when the process `parent` does."""
    global _study
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is meant for the service, which ends this process
    end_with(parent)
    read = StudySettings.from_json(settings)
    _study = read, read.sampler()


def take_up(history: History, direction: str, prepared: range) -> None:
    """Learn from these trials; the proposals of these numbers, made before, are still to be handed out."""
    global _optimizer, _made
    assert _study is not None
    settings, sampler = _study
    _optimizer = None  # nothing is proposed where this fails
    _made = {number: _made[number] for number in prepared}
    pending = np.concatenate([history.pending, settings.space.encode_all(list(_made.values()))])
    with sampler.optimizing(settings.space, history._replace(pending=pending), direction) as _optimizer:
        pass


def propose(number: int) -> dict[str, Any]:
    """Return the parameters of the trial of this number; all trials asked for before are pending."""
    assert _study is not None
    assert _optimizer is not None
    _made[number] = _study[0].space.complete(_optimizer.ask_trial(number=number).parameters)
    return _made[number]
