import os
import subprocess
import sys
import threading

import pytest

from surehold.store.locks import LockTaken, locked

HOLDER = """
import sys
from pathlib import Path
from surehold.store.locks import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the lock until it is killed."""
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "it.lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_who_does_not_wait_is_told_who_holds_it(tmp_path, holder):
    with pytest.raises(LockTaken) as error, locked(tmp_path / "it.lock", wait=False):
        pytest.fail("two processes hold the lock")
    assert error.value.owner == str(holder.pid)


def test_a_killed_process_holds_nothing(tmp_path, holder):
    holder.kill()
    holder.wait()
    with locked(tmp_path / "it.lock", wait=False):
        assert (tmp_path / "it.lock").read_text() == str(os.getpid())


def test_one_thread_at_a_time(tmp_path):
    inside, most = [], []

    def enter():
        for _ in range(20):
            with locked(tmp_path / "it.lock"):
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    threads = [threading.Thread(target=enter) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 80


def test_a_place_that_cannot_be_written_is_an_os_error(tmp_path):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(OSError, match="taken"), locked(tmp_path / "taken" / "it.lock"):
        pytest.fail("held a lock that is nowhere")
