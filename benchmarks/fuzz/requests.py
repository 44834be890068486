"""The service of a study, sent strange requests over plain sockets; it has to answer, or close, and to stay alive."""

import json
import os
import random
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.fuzz.findings import SECONDS, Findings
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

TOKEN = "strange-requests-0123456789"
PLACES = ("ask", "tell", "veto", "pause", "resume", "renew", "add", "status", "recommendation", "next", "trials", "..")
VALUES = (None, 0, -1, 1e308, 10**400, True, "x", "\ud800", [], {}, [[]], {"dx": 1}, "9" * 5000, float("nan"))


class Died(AssertionError):
    """The service does not answer any more."""


@contextmanager
def service(folder: Path) -> Iterator[tuple[str, int]]:
    """Serve a study in a process of its own; the errors that it prints are raised at the end."""
    url = str(folder / "served.log")
    RobotStudy.create("mug", StudySettings(SearchSpace({"dx": (-0.05, 0.05)}), None), url).close()
    command = [sys.executable, "-m", "surehold", "study", "serve", "mug", "--storage", url, "--port", "0"]
    environment = {**os.environ, "SUREHOLD_TOKEN": TOKEN}
    with open(folder / "errors", "w+") as errors:
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
            assert process.stdout is not None
            host, _, port = process.stdout.readline().split("http://")[1].split("/")[0].partition(":")
            try:
                yield host, int(port)
            finally:
                process.terminate()
        errors.seek(0)
        printed = errors.read()
        if "Traceback" in printed:
            raise Died(printed[-2000:])


def request(draw: random.Random) -> bytes:
    """Return one request, sound or strange."""
    method = draw.choice(["GET", "POST", "PUT", "HEAD", "DELETE", "\x00", "G" * 3000])
    place = draw.choice(["/", "/health", "//", "/%00", "/" + "a" * 9000, *[f"/studies/mug/{p}" for p in PLACES * 3]])
    body = {name: draw.choice(VALUES) for name in ("id", "value", "failed", "reached", "worker") if draw.random() < 0.5}
    text = json.dumps(body).encode() if draw.random() < 0.8 else draw.randbytes(draw.randint(0, 300))
    if draw.random() < 0.1:
        text = b"[" * draw.randint(1, 100_000)
    length = draw.choice([len(text)] * 8 + [0, 10**12, -1])
    lines = [f"{method} {place} HTTP/1.1", f"Host: {draw.choice(['127.0.0.1', 'localhost', 'evil.example', ''])}"]
    if draw.random() < 0.9:
        lines.append(f"Authorization: {draw.choice([f'Bearer {TOKEN}'] * 6 + ['Bearer x', 'Basic ', ''])}")
    lines += ["Content-Type: application/json", f"Content-Length: {length}", "Connection: close"]
    if draw.random() < 0.05:
        lines += [f"X-{i}: {'y' * 200}" for i in range(300)]
    return "\r\n".join(lines).encode("latin-1") + b"\r\n\r\n" + text


def _answer(address: tuple[str, int], data: bytes, ends: bool) -> bytes:
    with socket.create_connection(address, timeout=SECONDS) as connection:
        try:
            connection.sendall(data)
            if ends:
                connection.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # refused before it was read whole
        found = b""
        try:
            while piece := connection.recv(65536):
                found += piece
        except ConnectionResetError:
            pass
        return found


def send(draw: random.Random, findings: Findings, address: tuple[str, int]) -> None:
    """Send one request, and ask whether the service is alive."""
    data = request(draw)

    def sent() -> None:
        answer = _answer(address, data, ends=True)
        status = answer.split(b"\r\n", 1)[0]
        if b" 500 " in status or b"Traceback" in answer:
            raise AssertionError(answer[-300:].decode("latin-1"))
        alive = _answer(address, b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n", ends=False)
        if b"alive" not in alive:
            raise Died(f"/health answers {alive[:200]!r}")

    findings.attempt(repr(data[:300]), sent)
