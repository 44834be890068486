"""What counts as a fault: anything but a result or one line of `SureholdError`, and whatever takes too long."""

import signal
import time
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from surehold.errors import SureholdError

SECONDS = 30  #: of the processor, after which a call hangs; ten times as many on the clock, for one that waits
LONGEST = 900  #: characters of a message


class Findings:
    """Calls made, and one example of each kind of fault."""

    def __init__(self, journal: Path):
        self.calls = 0
        self.faults: dict[tuple[str, ...], str] = {}
        self._journal = journal

    def attempt(self, what: str, call: Callable[[], Any]) -> Any:
        """Return what the call returns, None where it fails; `what` says it in the list of faults."""
        self.calls += 1
        self._journal.write_text(what, encoding="utf-8", errors="backslashreplace")  # found there if the process dies
        began = time.process_time()
        try:
            with _in_time():
                return call()
        except SureholdError as error:
            if "\n" in str(error) or len(str(error)) > LONGEST:
                self.faults.setdefault(("no single line", str(error)[:80]), what)
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            ours = [f for f in traceback.extract_tb(error.__traceback__) if "/surehold/" in f.filename]
            places = [f"{Path(f.filename).name}:{f.lineno}" for f in [*ours[-2:], place]]
            self.faults.setdefault((type(error).__name__, *places), f"{str(error)[:100]}: {what}")
        if time.process_time() - began > SECONDS:
            self.faults.setdefault(("takes long", what[:60]), what)
        return None


@contextmanager
def _in_time() -> Any:
    def end(*_: Any) -> None:
        raise TimeoutError(f"no answer in {SECONDS} s")

    before = [signal.signal(number, end) for number in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.alarm(10 * SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for number, handler in zip((signal.SIGPROF, signal.SIGALRM), before, strict=True):
            signal.signal(number, handler)
