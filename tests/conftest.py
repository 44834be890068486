"""Profiles of hypothesis (`make explore` looks for new examples), and a PostgreSQL server where one can be had."""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("default", derandomize=True, deadline=None, database=None)
settings.register_profile(
    "explore", derandomize=False, deadline=None, max_examples=1000, suppress_health_check=[HealthCheck.too_slow]
)
# A test run that a script starts in the background ignores Ctrl-C, and so would all programs that tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ["SUREHOLD_WARM_UP"] = "0"  # no child processes but where a test asks for one
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))


def program(name):
    found = shutil.which(name)
    candidates = [found] if found else sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return str(candidates[-1]) if candidates else None


@pytest.fixture(scope="session")
def postgresql_server():
    """The URL of a server on the loopback interface, its data in a temporary folder; it goes with the session."""
    initdb, postgres = program("initdb"), program("postgres")
    if initdb is None or postgres is None:
        pytest.skip("PostgreSQL is not installed (Debian package postgresql)")
    user = []
    folder = Path(tempfile.mkdtemp(prefix="surehold-postgresql-"))
    if os.getuid() == 0:  # the server refuses to run as root
        if shutil.which("setpriv") is None:
            pytest.skip("PostgreSQL does not run as root, and setpriv is missing")
        user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
        os.chown(folder, 65534, 65534)
    data = folder / "data"
    made = subprocess.run(
        [*user, initdb, "-D", data, "-A", "trust", "-U", "surehold", "--no-sync", "-E", "UTF8", "--locale=C"],
        capture_output=True, text=True, cwd=folder, timeout=600,
    )  # fmt: skip
    if made.returncode:
        shutil.rmtree(folder, ignore_errors=True)
        pytest.skip(f"PostgreSQL cannot be set up here: {made.stderr.strip()}")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = {"listen_addresses": "127.0.0.1", "unix_socket_directories": "", "fsync": "off", "max_connections": "60"}
    settings = [part for key, value in options.items() for part in ("-c", f"{key}={value}")]
    with open(folder / "log", "wb") as log:
        server = subprocess.Popen(
            [*user, postgres, "-D", data, "-p", str(port), *settings], cwd=folder, stdout=log, stderr=log
        )
    url = f"postgresql://surehold@127.0.0.1:{port}"
    try:
        wait_for(url, server, folder / "log")
        yield url
    finally:
        server.terminate()
        server.wait(timeout=600)
        shutil.rmtree(folder, ignore_errors=True)


def wait_for(url, server, log):
    import psycopg

    for _ in range(300):
        try:
            psycopg.connect(f"{url}/postgres", connect_timeout=2).close()
            return
        except psycopg.OperationalError:
            if server.poll() is not None:
                pytest.skip(f"PostgreSQL does not start here: {log.read_text()[-500:]}")
            time.sleep(0.1)
    pytest.skip("PostgreSQL did not answer within 30 seconds")
