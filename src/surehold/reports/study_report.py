"""The report of a stored study: what it holds now, whoever made its trials."""

from typing import Any

from surehold.reports import gather
from surehold.reports.run_report import RunReport
from surehold.studies.replay import result_of
from surehold.studies.robot import RobotStudy

__all__ = ["study_report"]


def study_report(study: RobotStudy) -> RunReport:
    """Return the report of a study; raises InputError if no trial has given a value yet."""
    result = result_of(study)
    space, settings = study.settings.space, study.settings
    box = result.optimizer.box
    units = {
        name: f"{'log ' * bool(getattr(distribution, 'log', False))}{settings.units.get(name, '')}".strip()
        for name, distribution in space.distributions.items()
        if name in box.names
    }
    shown: dict[str, Any] = {"study": study.name, "storage": study.storage.shown, **settings.optimizer}
    pending = sum(not trial.state.is_finished() for trial in study.trials())
    notes = [f"{pending} trial{'s are' if pending > 1 else ' is'} still under way."] if pending else []
    if study.touches:
        notes.append(
            "What is expected of the answer is of the shapes that are possible; the maps are of the values told."
        )
    reason = study.paused or study.stopped()
    if reason:
        notes.append(f"The study is {'paused' if study.paused else 'stopped'}: {reason}.")
    rule = study.stop_rule
    rows = [space.decode(x) for x in result.optimizer.reached]
    names = [name for name in space.distributions if name not in box.names]
    return gather.report_of(
        result,
        [gather.candidate(result, label, index, None) for label, index in gather.answers(result).items()],
        title=f"Study {study.name}",
        settings=shown,
        noise=result.optimizer.input_noise,
        units=units,
        planned_trials=rule.trials,
        notes=notes,
        choices={name: tuple(str(row[name]) for row in rows) for name in names},
        hidden=[name for name in box.names if name not in space.distributions],
    )
