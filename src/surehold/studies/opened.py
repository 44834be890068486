"""A stored study, opened: its settings, its storage, and whether it hands out trials at all."""

import time
from functools import cached_property
from typing import TYPE_CHECKING, Final, Self

import numpy as np
import optuna
from optuna.study import Study, StudyDirection
from optuna.trial import FrozenTrial, TrialState

from surehold.errors import InputError
from surehold.optimization.limits import limits_of
from surehold.studies.export_columns import check_columns
from surehold.studies.ledger import PROMISE, Ledger
from surehold.studies.settings import SETTINGS, StudySettings
from surehold.studies.stop_rule import StopRule
from surehold.studies.storage import Storage, checked_name, open_storage

if TYPE_CHECKING:
    from surehold.studies.touch import TouchedShape

__all__ = ["OpenedStudy"]

_PAUSED: Final = "surehold:paused"  # study attribute: why; None where it is not paused
_STOP: Final = "surehold:stop"  # study attribute: a `StopRule`


class OpenedStudy:
    """A stored study, opened; see `create` and `open`.

    Attributes
    ----------
    name : its name
    settings : StudySettings
    storage : Storage
    study : the study of Optuna, with surehold's sampler
    sampler : that sampler
    limits : tuple of Limit, of the further outputs
    """

    def __init__(self, name: str, storage: Storage, study: Study, settings: StudySettings):
        self.name: Final = name
        self.storage: Final = storage
        self.settings: Final = settings
        self.study: Final = study
        self.sampler: Final = settings.sampler()
        study.sampler = self.sampler
        self.limits: Final = limits_of(settings.optimizer.get("constraints"))
        self._ledger: Final = Ledger(storage.backend, name, settings.space)

    @cached_property
    def _touched(self) -> "TouchedShape | None":
        """What is known of the shape that this study is about, if it is."""
        words = self.settings.problem.get("touch")
        if words is None:
            return None
        from surehold.studies.touch import TouchedShape

        return TouchedShape(words, self.settings.input_noise, int(self.settings.optimizer.get("seed", 0)))

    @classmethod
    def create(cls, name: str, settings: StudySettings, storage: str = "", *, resume: bool = False) -> Self:
        """Create a study, and open it.

        Parameters
        ----------
        name
            Letters, digits, '-', '_' and single dots.
        settings
            What it is; written into it.
        storage
            URL, see `surehold.studies.storage`; by default the journal runs/NAME/journal.log.
        resume
            Whether to open the study if it exists, and its settings agree.

        Raises
        ------
        InputError
            If the storage cannot be used, the study exists and may not be resumed or has other settings, or a parameter
            has the name of a column of the export.
        """
        check_columns(settings)
        opened = open_storage(storage, checked_name(name), create=True)
        with opened.closed_on_error(), opened.failures(), opened.handing_out():
            there = name in optuna.get_all_study_names(opened.backend)
            direction = StudyDirection[settings.direction.upper()]
            if there:
                study = optuna.load_study(study_name=name, storage=opened.backend)
            else:
                study = optuna.create_study(storage=opened.backend, study_name=name, direction=direction)
            if not there or _is_half_made(study, direction):
                study.set_user_attr(SETTINGS, settings.to_json())
            elif not resume:
                raise InputError(f"study '{name}' exists in {opened.shown}; use it, or choose another name.")
        found = cls._opened(name, opened)
        with opened.closed_on_error():
            differences = found.settings.differences(settings)
            if differences:
                raise InputError(
                    f"study '{name}' exists in {opened.shown} with other settings: {'; '.join(differences)}. "
                    "Give what is in the study, or leave out what is not, to resume it; or choose another name."
                )
        return found

    @classmethod
    def open(cls, name: str, storage: str = "") -> Self:
        """Open a study that exists.

        Raises
        ------
        InputError
            If the storage is not there or cannot be used, or holds no study of that name.
        """
        return cls._opened(name, open_storage(storage, checked_name(name), create=False))

    @classmethod
    def _opened(cls, name: str, storage: Storage) -> Self:
        with storage.closed_on_error(), storage.failures():
            names = optuna.get_all_study_names(storage.backend)
            if name not in names:
                there = f"there are {', '.join(names)}" if names else "there is none"
                raise InputError(f"study '{name}' is not in {storage.shown}; {there}. Create it first.")
            study = optuna.load_study(study_name=name, storage=storage.backend)
            return cls(name, storage, study, StudySettings.of(study))

    def close(self) -> None:
        """Close connections to a database."""
        self.storage.close()

    # --- ruling ---------------------------------------------------------------------------------------------------

    def pause(self, reason: str = "") -> None:
        """Hand out nothing until `resume`; trials under way can be told."""
        with self.storage.failures():
            self.study.set_user_attr(_PAUSED, reason or "no reason given")

    def resume(self) -> None:
        """Hand out trials again."""
        with self.storage.failures():
            if self.paused is not None:
                self.study.set_user_attr(_PAUSED, None)

    @property
    def paused(self) -> str | None:
        """Why the study is paused; None where it is not."""
        with self.storage.failures():
            return self.study.user_attrs.get(_PAUSED)

    @property
    def stop_rule(self) -> StopRule:
        """When asking ends."""
        with self.storage.failures():
            return StopRule.from_dict(self.study.user_attrs.get(_STOP))

    def set_stop_rule(self, rule: StopRule) -> None:
        """Store when asking ends; `StopRule()` never."""
        with self.storage.failures():
            if rule != self.stop_rule:
                self.study.set_user_attr(_STOP, rule.as_dict())

    def stopped(self) -> str:
        """Return why asking has ended, empty where it goes on."""
        with self.storage.failures():
            return self._stop_reason(self._ledger.trials(), time.time())[0]

    @property
    def n_initial(self) -> int:
        """Trials of the initial design."""
        return self.sampler.n_initial(self.settings.space)

    def promise(self) -> float | None:
        """Return the improvement that a further trial is expected to bring.

        None during the initial design, while no trial may become the answer, and of a study of an unknown shape.
        """
        with self.storage.failures():
            return self._promise(self._ledger.trials())

    # --- inside ---------------------------------------------------------------------------------------------------

    def _stop_reason(self, trials: list[FrozenTrial], now: float) -> tuple[str, float | None]:
        """Return why asking ends (empty where it goes on), and what the next trial promises where that is asked."""
        rule = self.stop_rule
        begun = sum(t.state != TrialState.WAITING for t in trials)
        reason = rule.reason(begun, now, [])
        if reason or rule.improvement is None:
            return reason, None
        promise = self._promise(trials)
        if promise is None:
            return "", None
        promised = [t.user_attrs[PROMISE] for t in trials if PROMISE in t.user_attrs]
        return rule.reason(begun, now, [*promised, promise]), promise

    def _promise(self, trials: list[FrozenTrial]) -> float | None:
        if self._touched is not None:
            return None
        history = self.sampler.history(trials, self.settings.space)
        if len(trials) < self.n_initial or not np.isfinite(history.y).any():
            return None
        with self.sampler.optimizing(self.settings.space, history, self.settings.direction) as optimizer:
            promise = optimizer.promise()
            return promise if np.isfinite(promise) else None


def _is_half_made(study: Study, direction: StudyDirection) -> bool:
    """Tell whether a study was created, but its settings not written: the creation was killed, or the disk was full."""
    return not study.user_attrs and not study.get_trials(deepcopy=False) and study.directions == [direction]
