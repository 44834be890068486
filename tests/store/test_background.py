"""Children that compile: started once, waited for, and never in the way. Most cases in a process of their own."""

import os
import shutil
import subprocess
import sys

import pytest

from surehold.store import background

PARENT = """
import logging, sys
from pathlib import Path
logging.basicConfig(format="%(message)s", stream=sys.stdout)
from surehold.store import background
marker = Path({folder!r}) / "warm-x"
child = {child!r}
{before}
background.begin(marker, child, b"settings")
background.begin(marker, child, b"settings")
print(len(background._children), len(background._elsewhere))
background.wait()
print(sorted(p.name for p in Path({folder!r}).iterdir()))
"""

CHILD = """
import os, sys, time
from pathlib import Path
from surehold.store.background import SWITCH, marking
assert sys.stdin.read() == "settings" and os.environ[SWITCH] == "0"
with marking(Path({folder!r}) / "warm-x") as wanted:
    with open(Path({folder!r}) / "made", "a") as made:
        made.write(str(wanted))
"""


def _run(folder, before="", **environment):
    here = {key: value for key, value in os.environ.items() if key != "SUREHOLD_WARM_UP"} | environment
    code = PARENT.format(folder=str(folder), child=CHILD.format(folder=str(folder)), before=before)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], env=here, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.stderr == "", done.stderr
    return done.stdout.splitlines()


DONE = "['made', 'warm-x', 'warm-x.lock']"


def test_one_child_is_started_and_waited_for(tmp_path):
    assert _run(tmp_path) == ["1 0", DONE]
    assert (tmp_path / "made").read_text() == "True"


def test_nothing_is_started_where_the_marker_stands(tmp_path):
    (tmp_path / "warm-x").touch()
    assert _run(tmp_path) == ["0 0", "['warm-x']"]


def test_nothing_is_started_where_the_environment_says_so(tmp_path):
    assert _run(tmp_path, SUREHOLD_WARM_UP="0") == ["0 0", "[]"]


def test_a_child_of_another_process_is_waited_for(tmp_path):
    before = f"""
import subprocess, threading
other = subprocess.Popen([sys.executable, "-c", '''
import time
from pathlib import Path
from surehold.store.background import marking
with marking(Path({str(tmp_path)!r}) / "warm-x"):
    print("held", flush=True)
    time.sleep(0.5)
'''], stdout=subprocess.PIPE)
other.stdout.readline()
"""
    after = _run(tmp_path, before + "import atexit; atexit.register(lambda: (other.wait(), other.stdout.close()))")
    assert after == ["0 1", "['warm-x', 'warm-x.lock']"]


def test_a_child_that_cannot_start_is_said_in_one_line(tmp_path):
    said = _run(tmp_path, "sys.executable = '/nowhere/python'")
    assert said[0].startswith("no process can be started that compiles kernels ahead ([Errno 2]")
    assert said[1:] == ["0 0", "['warm-x.lock']"]


def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path):
    """A second set of kernels says nothing more."""
    other = "background.begin(Path('/dev/null/warm-y'), child, b'settings')"
    said = _run(tmp_path, f"marker = Path('/dev/null/warm-x')\n{other}")
    assert said[0].startswith("compiled kernels cannot be kept (")
    assert said[0].endswith("each process compiles anew; set NUMBA_CACHE_DIR to a folder that can be written.")
    assert said[1:] == ["0 0", "[]"]


def test_a_cache_that_can_only_be_read_and_is_complete_says_nothing(tmp_path):
    (tmp_path / "warm-x").touch()
    refused = "def refuse(*_, **__): raise PermissionError(13, 'Permission denied')"
    assert _run(tmp_path, f"{refused}\nbackground.file_lock = refuse") == ["0 0", "['warm-x']"]


def test_a_child_that_fails_leaves_no_marker(tmp_path):
    said = _run(tmp_path, "child = 'raise SystemExit(1)'")
    assert said == ["1 0", "['warm-x.lock']"]


def test_a_child_goes_on_after_its_parent(tmp_path):
    folder = str(tmp_path)
    code = f"""
from pathlib import Path
from surehold.store import background
background.begin(Path({folder!r}) / "warm-x", {CHILD.format(folder=folder)!r}, b"settings")
"""
    here = {key: value for key, value in os.environ.items() if key != "SUREHOLD_WARM_UP"}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], env=here, capture_output=True, check=True)
    assert done.stderr == b""
    for _ in range(600):
        if (tmp_path / "warm-x").exists():
            return
        subprocess.run(["sleep", "0.1"], check=True)
    pytest.fail("the child has ended with its parent")


def test_a_marker_is_wanted_until_it_is_there_and_a_disk_that_keeps_none_stops_nothing(tmp_path):
    folder = tmp_path / "cache"
    folder.mkdir()
    for expected in (True, False, False):
        with background.marking(folder / "warm-y") as wanted:
            assert wanted is expected
    with background.marking(folder / "warm-z"):
        shutil.rmtree(folder)
    assert not folder.exists()


def test_a_child_that_has_ended_compiles_no_more(tmp_path, monkeypatch):
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    monkeypatch.setattr(background, "_children", [(child, tmp_path / "warm-x")])
    assert background.compiling()
    child.communicate(b"done")
    assert not background.compiling()
