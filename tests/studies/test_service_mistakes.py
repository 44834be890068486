"""What the service says to the usual slips of those who call it."""

import pytest
from fastapi.testclient import TestClient

from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.service import service
from surehold.studies.settings import StudySettings

TOKEN = "0123456789abcdef0123"
JSON, FORM = "application/json", "application/x-www-form-urlencoded"


@pytest.fixture(scope="module", params=["value", "success"])
def outcome(request):
    return request.param


@pytest.fixture(scope="module")
def client(outcome, tmp_path_factory):
    settings = StudySettings(SearchSpace({"dx": (-0.05, 0.05)}), None, {}, {"outcome": outcome})
    study = RobotStudy.create("arm", settings, str(tmp_path_factory.mktemp("slips") / "journal.log"))
    return TestClient(service(study, TOKEN), "http://127.0.0.1", headers={"Authorization": f"Bearer {TOKEN}"})


def said(client, call, body, kind=JSON):
    answer = client.post(f"/studies/arm/{call}", content=body, headers={"Content-Type": kind} if kind else {})
    assert answer.status_code == 422
    return answer.json()["detail"]


@pytest.mark.parametrize(
    ("call", "body", "kind", "words"),
    [
        ("ask", b"", None, "the body is missing; send {}, where wanted with worker."),
        ("ask", b"", FORM, "the body is missing; send {}"),
        ("ask", b'{"worker": "x"}', None, "the header 'Content-Type: application/json' is missing."),
        ("ask", b'{"worker": "x"}', FORM, f"is missing; the body was sent as '{FORM}'"),
        ("ask", b'{"wroker": "x"}', JSON, "field 'wroker' is unknown; did you mean 'worker'?"),
        ("tell", b"{}", JSON, "field 'id' is missing; send {\"id\": ...}, where wanted with value, failed"),
        ("tell", b"[1,2", JSON, "the body is no JSON (Expecting ',' delimiter, at character 4)"),
        ("tell", b"[1,2]", JSON, "the body is [1, 2], no JSON object"),
        ("tell", b'{"id": "3"}', JSON, 'id is "3"; it must be a valid integer.'),
        ("tell", b'{"id": 3, "failed": "no"}', JSON, 'failed is "no"; send true, false, or "rig" in tell.'),
        ("tell", b'{"id": 3, "reached": {"dx": NaN}}', JSON, "reached.dx is NaN; send a finite number, a text"),
    ],
)
def test_slips_of_the_body(client, call, body, kind, words):
    detail = said(client, call, body, kind)
    assert words in detail
    assert "Input should" not in detail


@pytest.mark.parametrize("body", [b"[" * 30_000, b'{"id": ' + b"9" * 5000 + b"}", b'{"id": "\xff"}'])
def test_a_body_that_no_json_can_be_made_of(client, body):
    answer = client.post("/studies/arm/tell", content=body, headers={"Content-Type": JSON})
    assert (answer.status_code, "cannot be read as JSON: too deep" in answer.json()["detail"]) == (400, True)


@pytest.mark.parametrize(
    ("call", "body", "name"),
    [
        ("tell", b'{"id": 0, "value": 1, "value": 2}', "value"),
        ("tell", b'{"id": 0, "value": 1, "reached": {"dx": 0.01, "dx": 0.02}}', "dx"),
        ("add", b'{"parameters": {"dx": 0.01}, "value": 1, "parameters": {"dx": 0.02}}', "parameters"),
    ],
)
def test_a_name_that_stands_twice_is_refused(client, call, body, name):
    answer = client.post(f"/studies/arm/{call}", content=body, headers={"Content-Type": JSON})
    assert answer.status_code == 400
    assert answer.json()["detail"] == f"the body names '{name}' twice; send each name once."
    assert client.get("/studies/arm/trials").json() == []


@pytest.mark.parametrize("value", ["NaN", '"abc"', "[1]"])
def test_a_wrong_value_is_told_once_what_the_study_takes(client, outcome, value):
    detail = said(client, "tell", f'{{"id": 3, "value": {value}}}'.encode())
    assert detail.startswith(f"value is {value}; send ")
    assert ("success" in detail) == (outcome == "success")
    assert ("finite" in detail) == (outcome == "value")


@pytest.mark.parametrize(
    ("method", "path", "hint"),
    [
        ("POST", "/ask", "did you mean POST /studies/arm/ask?"),
        ("POST", "/tell", "did you mean POST /studies/arm/tell?"),
        ("GET", "/status", "did you mean GET /studies/arm/status?"),
        ("GET", "/studies/arm/recommend", "did you mean GET /studies/arm/recommendation?"),
        ("GET", "/elsewhere", "calls are at /studies/arm/"),
    ],
)
def test_places_where_nothing_is(client, method, path, hint):
    answer = client.request(method, path)
    assert answer.status_code == 404
    assert hint in answer.json()["detail"]
    assert "The page at / describes all calls." in answer.json()["detail"]


def test_a_wrong_method_names_the_right_one(client):
    answer = client.get("/studies/arm/ask")
    assert answer.status_code == 405
    assert answer.headers["Allow"] == "POST"
    assert answer.json()["detail"] == "GET is not for '/studies/arm/ask'; use POST."
