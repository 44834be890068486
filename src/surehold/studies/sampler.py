"""surehold's optimizer as a sampler of Optuna: its storage, workers and dashboard with our suggestions.

What is suggested is a function of the settings, the stored trials and the number of the trial: nothing is remembered
that could change it, so a study can be interrupted, resumed and shared by any number of processes.
"""

import threading
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from optuna import logging
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, RandomSampler
from optuna.search_space import IntersectionSearchSpace
from optuna.study import Study, StudyDirection
from optuna.trial import FrozenTrial

from surehold.defaults import MANY, SUCCESS_PLACES
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, checked_input_noise
from surehold.optimization.optimizer import Optimizer, check_settings
from surehold.optimization.surrogates.protocol import Surrogate
from surehold.studies.allowed import allowed_in
from surehold.studies.history import History, Reader
from surehold.studies.search_space import SearchSpace

__all__ = ["Sampler"]

#: Settings that are about the variables, which a sampler without a search space does not know yet.
_OF_VARIABLES: Final = ("allowed", "fixed", "guess", "initial_points", "safety")
_log = logging.get_logger(__name__)


class Sampler(BaseSampler):
    """A sampler of Optuna that looks for what still holds when the input is off.

    Parameters
    ----------
    search_space
        The parameters, known from the first trial on: a `surehold.Box`, or `{name: (lower, upper)}`, or
        `{name: distribution}` of Optuna. None: those that all finished trials have in common, as Optuna's own samplers
        do; the first trial is then drawn at random. Parameters that are not among them are drawn at random.
    input_noise
        How far the reached input strays from the commanded one, in the parameters' units; of a log parameter the
        standard deviation of its natural logarithm. Integers are rounded after they have strayed. Choices carry none.
    seed
        Non-negative integer.
    surrogate
        As in `Optimizer`, whose default None stands for. It carries tens of thousands of trials: from
        `surehold.defaults.MANY` on a place is judged by the trials near it (of successes, from `SUCCESS_PLACES` on near
        ones count together), which is said once.
    warn_independent_sampling
        Whether to warn when a parameter is drawn at random because it is not in the search space.
    **settings
        Of `Optimizer`: criterion, n_initial, design, noise, output_range, quadrature, k, border, kappa, risk, preset,
        allowed, constraints, feasible, safety, failures, initial_points, guess, outcome. A function `allowed` takes the
        parameters {name: value}. The further outputs of a trial are its attributes of that name:
        `trial.set_user_attr("torque", 3.1)`. The chains of the thesis presets start anew for every suggestion.

    The direction of the study decides whether values are maximized or minimized; several objectives are refused.

    Raises
    ------
    InputError
        For unknown names and values out of range.

    Examples
    --------
    >>> import optuna
    >>> optuna.logging.set_verbosity(optuna.logging.WARNING)
    >>> sampler = Sampler({"x": (-1.0, 2.0)}, seed=0)
    >>> study = optuna.create_study(direction="maximize", sampler=sampler)
    >>> study.optimize(lambda trial: -((trial.suggest_float("x", -1.0, 2.0) - 0.5) ** 2), n_trials=12)
    >>> bool(abs(sampler.optimizer(study).recommend().x[0] - 0.5) < 0.01)
    True
    """

    def __init__(
        self,
        search_space: SearchSpace | Box | Mapping[str, tuple[float, float] | BaseDistribution] | None = None,
        *,
        input_noise: InputNoise | None = None,
        seed: int = 0,
        surrogate: str | Surrogate | None = None,
        warn_independent_sampling: bool = True,
        **settings: Any,
    ):
        if "constraints_func" in settings:
            raise InputError(
                "a sampler has no constraints_func; limits are constraints={'torque': (None, 3.0)}, of what a trial "
                "says by trial.set_user_attr('torque', 3.1)."
            )
        check_settings(settings)
        if "direction" in settings:
            raise InputError("a sampler has no direction of its own; say optuna.create_study(direction=...).")
        if settings.get("outcome") == "preference":
            raise InputError("a study keeps no preferences; make a surehold.Optimizer, and tell_preference(...).")
        if settings.get("noise") == "told":
            raise InputError("a study's trials do not tell their noise; give noise='inferred', or its deviation.")
        if search_space is None or isinstance(search_space, SearchSpace):
            self._space = search_space
        else:
            self._space = SearchSpace(search_space)
        self._input_noise = input_noise
        given = {} if surrogate is None else {"surrogate": surrogate}
        self._settings: dict[str, Any] = {**settings, **given, "seed": seed}
        self._said = False
        self._warn = warn_independent_sampling
        self._common = IntersectionSearchSpace()
        self._kept: tuple[tuple[Any, ...], Optimizer] | None = None  # saves time, changes nothing
        self._reader: tuple[dict[str, BaseDistribution], Reader] | None = None  # as well
        self._lock = threading.RLock()
        # What is wrong is told now, not at the first trial.
        if self._space is None:
            anything = None if checked_input_noise(input_noise, ("x",)) is None else InputNoise.unit(0.1)
            nameless = {name: value for name, value in self._settings.items() if name not in _OF_VARIABLES}
            Optimizer(Box.unit(1), input_noise=anything, **nameless)
        elif self._space.box is not None:
            self._new_optimizer(self._space, "maximize")

    # --- Optuna's interface -------------------------------------------------------------------------------------

    def infer_relative_search_space(self, study: Study, trial: FrozenTrial) -> dict[str, BaseDistribution]:
        """Return the search space given at construction, or what the finished trials have in common."""
        if self._space is not None:
            return dict(self._space.distributions)
        return self._common.calculate(study)

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Return the parameters of a trial."""
        self._raise_error_if_multi_objective(study)
        if not search_space:
            return {}
        space = self._space
        if space is None or space.distributions != search_space:
            space = SearchSpace(search_space)
        return self.suggest(study.get_trials(deepcopy=False), trial.number, direction_of(study), space)

    def sample_independent(
        self, study: Study, trial: FrozenTrial, param_name: str, param_distribution: BaseDistribution
    ) -> Any:
        """Return a parameter outside of the search space, drawn at random from (seed, trial number, name)."""
        self._raise_error_if_multi_objective(study)
        if self._warn and (self._space is not None or self._common.calculate(study)):
            _log.warning(
                f"Parameter '{param_name}' of trial {trial.number} is drawn at random: it is not in the search space, "
                "or its range differs. Give all parameters to surehold.Sampler, or warn_independent_sampling=False."
            )
        name = zlib.crc32(param_name.encode())
        seed = int(np.random.SeedSequence([self._settings["seed"], trial.number, name]).generate_state(1)[0])
        return RandomSampler(seed=seed).sample_independent(study, trial, param_name, param_distribution)

    def reseed_rng(self) -> None:
        """Do nothing: what is drawn depends on the number of the trial, which no two workers share."""

    # --- ours ---------------------------------------------------------------------------------------------------

    def suggest(
        self, trials: Sequence[FrozenTrial], number: int, direction: str, space: SearchSpace | None = None
    ) -> dict[str, Any]:
        """Return the parameters of trial `number`, given all trials of the study and its direction."""
        space = space or self._known_space()
        if space.box is None:
            return space.complete({})
        with self.optimizing(space, self.history(trials, space, number), direction) as optimizer:
            return space.complete(optimizer.ask_trial(number=number).parameters)

    def history(self, trials: Iterable[FrozenTrial], space: SearchSpace, number: int | None = None) -> History:
        """Return what all trials of a study say, as `history_of` does; only new ones are read."""
        with self._lock:
            if self._reader is None or self._reader[0] != space.distributions:
                self._reader = (space.distributions, Reader(space, self.outputs))
            return self._reader[1].read(trials, number)

    def optimizer(self, study: Study) -> Optimizer:
        """Return a new optimizer that has been told the study's trials.

        Raises
        ------
        InputError
            If the study has several objectives, or no parameter can vary.
        """
        space = self.search_space(study)
        history = self.history(study.get_trials(deepcopy=False), space)
        optimizer = self._new_optimizer(space, direction_of(study))
        optimizer.restore(
            history.X,
            history.y,
            reached=history.reached,
            pending=history.pending,
            outputs=history.outputs,
            of=history.executions,
        )
        return optimizer

    def search_space(self, study: Study) -> SearchSpace:
        """Return the search space, where none was given the one that the study's trials have in common.

        Raises
        ------
        InputError
            If there is none.
        """
        if self._space is not None:
            return self._space
        common = self._common.calculate(study)
        if not common:
            raise InputError(f"study '{study.study_name}' has no finished trial yet; its parameters are not known.")
        return SearchSpace(common)

    def n_initial(self, space: SearchSpace) -> int:
        """Return the size of the initial design in a search space."""
        given, points = self._settings.get("n_initial"), self._settings.get("initial_points")
        first = 0 if points is None else len(points)
        if self._settings.get("safety") is not None:
            return max(first, 1)  # without any, the optimizer says that it needs them
        if given is None:
            box = space.box or Box.unit(1)
            given = Optimizer.default_n_initial(box, len(box.variables) - len(self._settings.get("fixed") or ()))
        return max(given, first) if first else given

    @contextmanager
    def optimizing(self, space: SearchSpace, history: History, direction: str) -> Iterator[Optimizer]:
        """Lend an optimizer that has been told a history, to one thread at a time.

        Raises
        ------
        InputError
            If every parameter can take one value only.
        """
        with self._lock:
            key = (tuple(space.distributions.items()), direction)
            if self._kept is None or self._kept[0] != key:
                self._kept = (key, self._new_optimizer(space, direction))
            optimizer = self._kept[1]
            many = SUCCESS_PLACES if optimizer.outcome == "success" else MANY
            if len(history.y) > many and not self._said:
                self._said = True
                _log.warning(f"The study has more than {many} trials: a place is judged by those near it from now on.")
            optimizer.restore(
                history.X,
                history.y,
                reached=history.reached,
                pending=history.pending,
                outputs=history.outputs,
                of=history.executions,
            )
            yield optimizer

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the further outputs, in the order of `constraints`."""
        return tuple(self._settings.get("constraints") or ())

    def _known_space(self) -> SearchSpace:
        if self._space is None:
            raise InputError("the sampler has no search space of its own; give one at its construction.")
        return self._space

    def _new_optimizer(self, space: SearchSpace, direction: str) -> Optimizer:
        if space.box is None:
            raise InputError("every parameter can take one value only; there is nothing to optimize.")
        settings: dict[str, Any] = {**self._settings, "n_initial": self.n_initial(space), "direction": direction}
        settings["allowed"] = allowed_in(space, settings.get("allowed"))
        return Optimizer(space.box, input_noise=self._input_noise, **settings)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_kept": None, "_reader": None, "_lock": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"_lock": threading.RLock()})


def direction_of(study: Study) -> str:
    """Return "maximize" or "minimize"; raises InputError for a study with several objectives."""
    if len(study.directions) != 1:
        raise InputError(f"study '{study.study_name}' has {len(study.directions)} objectives; surehold takes one.")
    return "maximize" if study.direction == StudyDirection.MAXIMIZE else "minimize"
