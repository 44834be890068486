"""A little of the fuzz run; `python -m benchmarks.fuzz` makes ten minutes of it."""

import random

import pytest

from benchmarks.fuzz import calls, files, requests
from benchmarks.fuzz.findings import Findings


@pytest.mark.filterwarnings("ignore")
def test_strange_calls_are_refused_in_one_line(tmp_path):
    findings, draw = Findings(tmp_path / "under way"), random.Random(1)
    for _ in range(25):
        calls.call(draw, findings)
    assert findings.calls > 100
    assert not findings.faults


@pytest.mark.filterwarnings("ignore")
def test_damaged_files_are_refused_in_one_line(tmp_path):
    findings, draw = Findings(tmp_path / "under way"), random.Random(1)
    known = files.readers(tmp_path)
    assert all(reader(tmp_path / f"sound-{name}") is not False for name, _, reader in sound(tmp_path, known))
    for _ in range(300):
        files.read(draw, findings, tmp_path, known)
    assert findings.calls == 300
    assert not findings.faults


def sound(folder, known):
    """Write the files as they are: each of them is read."""
    for name, content, _ in known:
        (folder / f"sound-{name}").write_bytes(content)
    return known


def test_the_service_withstands_strange_requests(tmp_path):
    findings, draw = Findings(tmp_path / "under way"), random.Random(1)
    with requests.service(tmp_path) as address:
        for _ in range(60):
            requests.send(draw, findings, address)
    assert findings.calls == 60
    assert not findings.faults


def test_what_counts_as_a_fault(tmp_path):
    findings = Findings(tmp_path / "under way")
    findings.attempt("divides", lambda: 1 / 0)
    assert [kind[0] for kind in findings.faults] == ["ZeroDivisionError"]
