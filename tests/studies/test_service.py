import contextlib
import os
import socket
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import httpx
import pytest
from fastapi.testclient import TestClient
from optuna.trial import TrialState

import surehold as sh
from surehold.errors import InputError
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.service import service
from surehold.studies.service_guard import Impatience
from surehold.studies.settings import StudySettings
from surehold.studies.stop_rule import StopRule

TOKEN = "0123456789abcdef0123"
SPACE = SearchSpace({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
SETTINGS = StudySettings(SPACE, sh.InputNoise.unit(0.03), {"dx": "m", "dy": "m"}, {"n_initial": 6})


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A real service in a process of its own, and a client that knows its token."""
    url = str(tmp_path_factory.mktemp("served") / "journal.log")
    study = RobotStudy.create("mug", SETTINGS, url)
    command = [sys.executable, "-m", "surehold", "study", "serve", "mug", "--storage", url, "--port", "0"]
    environment = {**os.environ, "SUREHOLD_TOKEN": TOKEN}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    assert "Serving study mug" in line, process.communicate()
    address = line.split(" at ")[1].split("/ ")[0]
    client = httpx.Client(base_url=f"{address}/studies/mug", headers={"Authorization": f"Bearer {TOKEN}"}, timeout=600)
    with client:
        yield client, study, address
    process.terminate()
    _, errors = process.communicate(timeout=600)
    assert "Traceback" not in errors, errors


@pytest.fixture
def client(served):
    yield served[0]
    assert served[0].get(f"{served[2]}/health").json() == {"alive": True}, "the service died"


@pytest.fixture
def study(served):
    return served[1]


def test_ask_and_tell(client, study):
    asked = client.post("/ask", json={}).json()
    assert asked["units"] == {"dx": "m", "dy": "m"}
    stored = study.trials()[asked["id"]]
    assert stored.state == TrialState.RUNNING, "answered before it was stored"
    assert stored.params == asked["parameters"]
    answer = {"id": asked["id"], "value": 0.5, "reached": {"dx": 0.001}}
    assert client.post("/tell", json=answer).json() == {
        "id": asked["id"], "state": "complete", "value": 0.5, "already": False, "of": 1,
    }  # fmt: skip
    assert study.trials()[asked["id"]].value == 0.5
    assert client.post("/tell", json=answer).json()["already"]
    different = client.post("/tell", json=answer | {"value": 0.6})
    assert different.status_code == 409
    assert "told before: value 0.5" in different.json()["detail"]
    best = client.get("/recommendation").json()
    assert best["trial"] == asked["id"]
    assert best["parameters"]["dx"] == 0.001


def test_a_fault_of_the_rig(client):
    asked = client.post("/ask", json={}).json()
    told = client.post("/tell", json={"id": asked["id"], "failed": "rig"})
    assert told.json()["state"] == "waiting"
    assert client.post("/ask", json={}).json() == asked | {"again": True}


def test_people_in_the_loop(client, study):
    asked = client.post("/ask", json={"worker": "arm"}).json()
    assert client.post("/ask", json={"worker": "arm"}).json() == asked | {"again": True}
    assert client.post("/veto", json={"id": asked["id"], "reason": "table"}).status_code == 200
    assert client.post("/tell", json={"id": asked["id"], "value": 1.0}).status_code == 409
    preview = client.get("/next").json()["parameters"]
    assert client.post("/pause", json={"reason": "lunch"}).json()["state"] == "paused"
    for paused in (client.post("/ask", json={}), client.get("/next")):
        assert paused.status_code == 409
        assert "paused (lunch)" in paused.json()["detail"]
    assert client.get("/status").json()["state"] == "paused"
    assert client.post("/resume").json()["state"] == "open"
    assert client.post("/ask", json={}).json()["parameters"] == preview
    added = client.post("/add", json={"parameters": {"dx": 0.0, "dy": 0.0}, "value": 0.1}).json()["id"]
    assert client.get("/trials").json()[added]["value"] == 0.1
    study.set_stop_rule(StopRule(trials=1))
    stopped = client.post("/ask", json={})
    assert stopped.status_code == 409
    assert "budget" in stopped.json()["detail"]
    study.set_stop_rule(StopRule())


def test_counts_of_successes(tmp_path):
    settings = StudySettings(SETTINGS.space, None, {}, {"seed": 0, "outcome": "success"})
    held = RobotStudy.create("held", settings, str(tmp_path / "journal.log"))
    client = TestClient(service(held, TOKEN), "http://127.0.0.1", headers={"Authorization": f"Bearer {TOKEN}"})
    id = client.post("/studies/held/ask", json={}).json()["id"]
    for wrong in ({"successes": 8, "of": 7}, {"successes": 1}, {"successes": 1, "of": 2, "value": "success"}):
        refused = client.post("/studies/held/tell", json={"id": id} | wrong)
        assert refused.status_code == 422
        assert "successes" in refused.json()["detail"]
    taken = client.post("/studies/held/tell", json={"id": id, "successes": 7.0, "of": 10}).json()
    assert taken == {"id": id, "state": "complete", "value": 0.7, "already": False, "of": 10}
    at = {"parameters": {"dx": 0.0, "dy": 0.0}, "successes": 2, "of": 4}
    client.post("/studies/held/add", json=at)
    for told in (True, False):
        client.post("/studies/held/add", json={"parameters": {"dx": 0.01, "dy": 0.0}, "value": told})
    trials = client.get("/studies/held/trials").json()
    assert [(trial["value"], trial["of"]) for trial in trials] == [(0.7, 10), (0.5, 4), (1.0, 1), (0.0, 1)]


BAD_BODIES = [
    b"", b"{", b"[]", b"null", b'"text"', b"\xff\xfe", b"[" * 30_000, b'{"id": 0, "value": NaN}',
    b'{"id": 0, "value": Infinity}', b'{"id": 0, "value": 1e999}', b'{"id": 0, "value": "0.5"}',
    b'{"id": 0, "value": true}', b'{"id": 0, "value": [1]}', b'{"id": 0, "value": 1, "failed": true}',
    b'{"id": 0}', b'{"id": -1, "value": 1}', b'{"id": 1.5, "value": 1}', b'{"id": "0", "value": 1}',
    b'{"id": 99999999999999999999999, "value": 1}', b'{"value": 1}', b'{"id": 0, "value": 1, "extra": 1}',
    b'{"id": 0, "value": 1, "reached": {"dx": 1e300}}', b'{"id": 0, "value": 1, "reached": {"dz": 0}}',
    b'{"id": 0, "value": 1, "reached": {"dx": NaN}}', b'{"id": 0, "value": 1, "reached": [1, 2]}',
    b'{"id": 0, "successes": 1, "of": 2}', b'{"id": 0, "successes": 1.5, "of": 2}', b'{"id": 0, "of": true}',
]  # fmt: skip


@pytest.mark.parametrize("body", BAD_BODIES)
def test_bad_answers(client, study, body):
    before = len(study.trials()), [t.state for t in study.trials()]
    response = client.post("/tell", content=body, headers={"Content-Type": "application/json"})
    assert 400 <= response.status_code < 500, response.text
    assert response.json()["detail"]
    assert (len(study.trials()), [t.state for t in study.trials()]) == before


def test_unknown_ids_and_names(client):
    response = client.post("/tell", json={"id": 2_000_000, "value": 1.0})
    assert (response.status_code, "not in study" in response.json()["detail"]) == (404, True)
    root = str(client.base_url).rstrip("/").removesuffix("/studies/mug")
    for name in (
        "cup",
        "..",
        "%2e%2e",
        "..%2f..%2fetc%2fpasswd",
        "%00",
        "mug%2f..%2fcup",
        "mug ",
        "a" * 5000,
        "%F0%28",
    ):
        response = client.post(f"{root}/studies/{name}/ask", json={})
        assert response.status_code in (404, 405), (name, response.status_code)
    for path in ("/studies", "/../etc/passwd", "//etc/passwd", "/studies/mug/ask/../../../x"):
        assert client.get(root + path).status_code in (404, 405)
    assert client.put(f"{root}/studies/mug/ask").status_code == 405


@pytest.mark.parametrize(
    "header", [None, "", "Bearer", "Bearer wrong", f"Basic {TOKEN}", f"Bearer {TOKEN}x", "Bearer é"]
)
def test_without_the_token(client, header):
    headers = {} if header is None else {"Authorization": header.encode("latin-1")}
    root = str(client.base_url)
    for method, path in (("GET", "status"), ("GET", "trials"), ("POST", "ask"), ("POST", "tell"), ("POST", "pause")):
        response = httpx.request(method, root + path, headers=headers, json={} if method == "POST" else None)
        assert response.status_code == 401, response.text
        assert "id" not in response.json()


@pytest.mark.parametrize("chunked", [False, True])
def test_oversized_bodies(client, chunked):
    piece = b" " * 1024
    content = (piece for _ in range(200)) if chunked else piece * 200
    response = client.post("/ask", content=content, headers={"Content-Type": "application/json"})
    assert response.status_code == 413
    assert "larger than" in response.json()["detail"]


def talk(client, request):
    """Send bytes over a connection of its own, and return all that comes back until the service closes it."""
    host, port = client.base_url.host, client.base_url.port
    with socket.create_connection((host, port), timeout=600) as connection:
        connection.sendall(request)
        answer = connection.recv(65536)
        with contextlib.suppress(ConnectionError):
            while block := connection.recv(65536):
                answer += block
    return answer


def head(*lines, token=TOKEN, host="127.0.0.1"):
    return "\r\n".join(
        ["POST /studies/mug/ask HTTP/1.1", f"Host: {host}", f"Authorization: Bearer {token}", *lines, "", ""]
    ).encode()


def test_a_body_that_is_declared_too_large_is_not_waited_for(client):
    """The body is never sent: an answer shows that it was not read."""
    answer = talk(client, head("Content-Length: 100000000000"))
    assert answer.startswith(b"HTTP/1.1 413"), answer
    assert b"connection: close" in answer.lower()


def test_the_token_is_checked_before_the_body(client):
    answer = talk(client, head("Content-Length: 100000000000", token="wrong"))
    assert answer.startswith(b"HTTP/1.1 401"), answer
    assert talk(client, head("Content-Length: 10", token="wrong")).startswith(b"HTTP/1.1 401")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost@evil", ""])
def test_foreign_hosts_are_refused(client, host):
    """A web page whose name has been turned to the loopback address (DNS rebinding) sends its own name."""
    answer = talk(client, head("Content-Length: 2", host=host))
    assert answer.startswith(b"HTTP/1.1 400"), answer
    port = client.base_url.port
    for own in ("localhost", f"localhost:{port}", f"127.0.0.1:{port}"):
        headers = {"Host": own}
        assert client.get("/status", headers=headers).status_code == 200


IMPATIENT = """
import sys
from surehold.studies.robot import RobotStudy
from surehold.studies.service import listening, service
study = RobotStudy.open("mug", sys.argv[1])
with listening(0) as server:
    print(server.address, flush=True)
    server.run(service(study, sys.argv[2], patience=0.3), patience=0.3)
"""


def test_slow_callers_are_dropped(study):
    command = [sys.executable, "-c", IMPATIENT, study.storage.url, TOKEN]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        with httpx.Client(base_url=process.stdout.readline().strip()) as impatient:
            assert talk(impatient, head("Content-Length: 10") + b"{").startswith(b"HTTP/1.1 408")
            assert talk(impatient, b"POST /studies/mug") == b"", "half of a head is not waited for"
            assert talk(impatient, b"") == b"", "nor a connection that says nothing"
            assert impatient.get("/health").json() == {"alive": True}
        process.terminate()


def test_callers_that_do_not_read_are_dropped():
    class Transport:
        aborted = False

        def abort(self):
            self.aborted = True

    class Connection:
        def __init__(self, response_complete, write_paused):
            self.cycle = SimpleNamespace(response_complete=response_complete)
            self.flow = SimpleNamespace(write_paused=write_paused)
            self.transport = Transport()

    computing, full, idle = Connection(False, False), Connection(False, True), Connection(True, False)
    impatience = Impatience(0.0)
    for _ in range(2):
        impatience({computing, full, idle})
    assert [c.transport.aborted for c in (computing, full, idle)] == [False, True, True]


def test_the_page_and_the_description(client):
    root = str(client.base_url).removesuffix("studies/mug/")
    page = httpx.get(root)
    assert "POST /studies/{name}/ask" in page.text
    assert "http" not in page.text.split("<body>")[-1].replace("openapi.json", ""), "the page must need no network"
    described = httpx.get(f"{root}openapi.json").json()
    assert described["paths"]["/studies/{name}/tell"]["post"]["requestBody"]["required"]


def test_clients_at_once_lose_nothing(client, study):
    """8 clients ask and tell 80 trials; benchmarks/study_service.py does it with a thousand."""
    before = len(study.trials())
    lock, told = threading.Lock(), {}

    def robot(k):
        with httpx.Client(base_url=client.base_url, headers=client.headers, timeout=600) as own:
            for _ in range(10):
                asked = own.post("/ask", json={"worker": f"robot {k}"}).json()
                value = -abs(asked["parameters"]["dx"])
                assert own.post("/tell", json={"id": asked["id"], "value": value}).status_code == 200
                with lock:
                    assert asked["id"] not in told
                    told[asked["id"]] = value

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(robot, range(8)))
    stored = study.trials()[before:]
    assert {t.number: t.value for t in stored} == told
    assert len(told) == 80
    assert len({tuple(t.params.values()) for t in stored}) == 80


def test_the_port_and_the_token_are_checked(tmp_path):
    from surehold.studies.service import listening, new_token, service

    study = RobotStudy.create("mug", SETTINGS, str(tmp_path / "journal.log"))
    for token in ("", "short", "with spaces in between", "x" * 15, "ü" * 20, "line\nbreak" * 3):
        with pytest.raises(InputError, match="token"):
            service(study, token)
    assert new_token() != new_token()
    with listening(0) as server:
        port = int(server.address.rsplit(":", 1)[1])
        with pytest.raises(InputError, match="cannot be used"), listening(port):
            pass


def test_schemathesis_finds_nothing(served, tmp_path):
    """Requests made up from the OpenAPI description, good and bad ones: no 5xx, no answer that it does not describe.

    Left out is the check that whatever fits the description is accepted: it cannot say that a value or `failed` must be
    there, nor which ranges the parameters have.
    """
    _, _, address = served
    command = [sys.executable, "-m", "schemathesis.cli", "run", f"{address}/openapi.json", "--checks", "all"]
    command += ["--header", f"Authorization: Bearer {TOKEN}", "--max-examples", "4", "--seed", "1", "--no-color"]
    command += ["--exclude-checks", "positive_data_acceptance", "--request-timeout", "600"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "Tested: 11" in run.stdout, run.stdout
