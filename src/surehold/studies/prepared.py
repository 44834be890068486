"""Proposals made ahead in a child process, for a study that is asked by many at once.

An ask that finds no other one under way is answered by the model of all trials told so far: a single client never
meets a prepared proposal. Where asks overlap, and for `CALM` seconds after, they take proposals from a queue:

- A proposal is prepared for one trial number, with all trials before that number told or pending, and handed out under
  this number or not at all. A trial that came between (added by hand, handed out by another process) empties the queue.
- Its model is at most `STALENESS` told answers behind those of the moment in which it is handed out; how many is
  written into the trial (`BEHIND`). What would be further behind is dropped, and made anew while the ask waits.

As long as nobody has told anything since the proposal was made, it is the point that the model in this process gives.
"""

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Final

from optuna.trial import FrozenTrial

from surehold.studies.proposer import begin, propose, take_up
from surehold.studies.robot import Asked, RobotStudy

__all__ = ["AHEAD", "CALM", "RENEWED", "STALENESS", "Prepared"]

#: Proposals in the queue; told answers after which the model is made anew; told answers that a proposal handed out may
#: be behind: about one queue and one renewal, and as much again for answers that come in a burst.
AHEAD: Final = 32
RENEWED: Final = 16
STALENESS: Final = 64
#: Seconds after the last overlap of two asks for which proposals are still taken from the queue.
CALM: Final = 10.0

_log = logging.getLogger("surehold")


class Prepared:
    """Asks of a study, answered from proposals made ahead where they overlap.

    Not of a study about a shape that is touched: its trials are always made when they are asked for.
    """

    def __init__(self, study: RobotStudy):
        self._study = study
        self._count = threading.Lock()
        self._asking = 0
        self._crowded_until = float("-inf")
        self._child: ProcessPoolExecutor | None = None
        self._ready: Future[None] | None = None
        self._possible = "touch" not in study.settings.problem and study.settings.space.box is not None
        self._queue: deque[tuple[int, int, Future[dict[str, Any]]]] = deque()  # number, answers known, parameters
        self._known = -1  # told answers that the child's model knows

    def ask(self, worker: str | None = None) -> Asked:
        """Hand out a trial, as `RobotStudy.ask` does."""
        with self._count:
            self._asking += 1
            if self._asking > 1:
                self._crowded_until = time.monotonic() + CALM
        try:
            return self._study.ask(worker, prepared=self.proposal)
        finally:
            with self._count:
                self._asking -= 1

    def proposal(self, trials: Sequence[FrozenTrial]) -> tuple[dict[str, Any], int] | None:
        """Return the parameters of the next trial and how many told answers they are behind; None where none are ready.

        For one thread at a time: the study's lock is held.
        """
        if not self._possible or time.monotonic() > self._crowded_until or not self._started():
            return None
        number, told = len(trials), sum(trial.state.is_finished() for trial in trials)
        if self._queue and (self._queue[0][0] != number or told - self._queue[0][1] > STALENESS):
            self._empty()
        try:
            self._fill(trials, number, told)
            _, known, future = self._queue.popleft()
            return future.result(), told - known
        except Exception as error:  # whatever it is: where this process meets it as well it is raised there
            _log.warning(
                f"no proposals are prepared any more ({error or type(error).__name__}); each ask makes its own."
            )
            self._possible = False
            self.close()
            return None

    def close(self) -> None:
        """End the child process."""
        self._empty()
        if self._child is not None:
            self._child.shutdown(cancel_futures=True)
            self._child = None

    def _started(self) -> bool:
        """Tell whether the child is ready; it is started where there is none."""
        if self._child is None:
            # Not a fork: this process has threads.
            self._child = ProcessPoolExecutor(1, get_context("spawn"))
            self._ready = self._child.submit(begin, self._study.settings.to_json(), os.getpid())
        return self._ready is not None and self._ready.done()

    def _fill(self, trials: Sequence[FrozenTrial], number: int, told: int) -> None:
        """Order proposals for the numbers from `number` on that have none yet."""
        assert self._child is not None
        following = number + len(self._queue)
        if not self._queue or told - self._known >= RENEWED:
            history = self._study.sampler.history(trials, self._study.settings.space)
            self._child.submit(take_up, history, self._study.settings.direction, range(number, following))
            self._known = told
        for k in range(following, number + AHEAD):
            self._queue.append((k, self._known, self._child.submit(propose, k)))

    def _empty(self) -> None:
        for *_, future in self._queue:
            future.cancel()
        self._queue.clear()
