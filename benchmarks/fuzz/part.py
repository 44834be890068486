"""One part of the fuzz run, in a process of its own."""

import logging
import random
import resource
import sys
import time
import warnings
from pathlib import Path

from benchmarks.fuzz import calls, files, requests
from benchmarks.fuzz.findings import Findings

MEMORY = 6 << 30  #: bytes of address space


def run(part: str, seed: int, seconds: float, folder: Path) -> None:
    """Try for so many seconds, and write what was found."""
    warnings.simplefilter("ignore")
    logging.disable()
    findings, draw, end = Findings(folder / "under way"), random.Random(f"{part} {seed}"), time.monotonic() + seconds
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if part == "calls":
        while time.monotonic() < end:
            calls.call(draw, findings)
    elif part == "files":
        known = files.readers(folder)
        while time.monotonic() < end:
            files.read(draw, findings, folder, known)
    else:
        with requests.service(folder) as address:
            while time.monotonic() < end:
                requests.send(draw, findings, address)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"{part}: {findings.calls} calls, {len(findings.faults)} kinds of faults, at most {peak} MB", flush=True)
    for kind, example in findings.faults.items():
        print(f"  {' | '.join(kind)}\n    {example[:400]}", flush=True)
    sys.exit(1 if findings.faults else 0)
