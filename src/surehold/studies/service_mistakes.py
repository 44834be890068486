"""What the HTTP service answers to mistakes: what is wrong with a request, and what to send instead."""

import json
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Final, get_type_hints

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from surehold.errors import InputError, SureholdError, unknown_name
from surehold.studies.ledger import AnswerRefused, UnknownTrial
from surehold.studies.robot import NothingToAsk
from surehold.studies.storage import StorageFailure

__all__ = ["say_what_is_wrong"]

_JSON: Final = "'Content-Type: application/json'"
_ANY: Final = "a finite number, a text, true or false"
#: What is valid where several types are; without this each of them would complain of its own.
_VALID: Final = {
    "failed": 'true, false, or "rig" in tell',
    "reached": _ANY,
    "parameters": _ANY,
    "constraints": "a finite number, or null where it was not measured",
}
_VALUE: Final = "a finite number, or leave it out and send failed: true"
_SUCCESS: Final = 'true or "success", false or "failure", or in its place successes and of'


def say_what_is_wrong(app: FastAPI, study: str, counted: bool) -> None:
    """Let an application that serves a study answer mistakes in words; `counted`: the study is about success."""
    codes = ((StorageFailure, 503), (UnknownTrial, 404), (AnswerRefused, 409), (InputError, 422), (NothingToAsk, 409))

    def answer(code: int, detail: str, headers: Mapping[str, str] | None = None) -> JSONResponse:
        return JSONResponse({"detail": " ".join(detail.split())}, code, headers)

    @app.exception_handler(RequestValidationError)
    def malformed(request: Request, error: RequestValidationError) -> JSONResponse:
        fields = _fields(request.scope["route"].endpoint)
        return answer(422, _wrong_body(error.errors(), fields, request.headers.get("content-type", ""), counted))

    @app.exception_handler(SureholdError)
    def refused(_: Request, error: SureholdError) -> JSONResponse:
        return answer(next((code for kind, code in codes if isinstance(error, kind)), 409), str(error))

    @app.exception_handler(HTTPException)
    def unserved(request: Request, error: HTTPException) -> JSONResponse:
        path, detail = request.scope["path"], error.detail
        if error.status_code == 404 and detail == "Not Found":
            detail = _not_found(path, study, [route for route in app.routes if isinstance(route, APIRoute)])
        elif error.status_code == 405:
            allowed = (error.headers or {}).get("Allow", "another method")
            detail = f"{request.method} is not for {path[:100]!r}; use {allowed}."
        return answer(error.status_code, detail, error.headers)


def _not_found(path: str, study: str, routes: Sequence[APIRoute]) -> str:
    calls = {route.path.rsplit("/", 1)[-1]: route for route in routes if "{name}" in route.path}
    near = get_close_matches(path.rstrip("/").rsplit("/", 1)[-1], list(calls), n=1)
    hint = f"calls are at /studies/{study}/, such as /studies/{study}/ask"
    if near:
        (method,) = calls[near[0]].methods or {"GET"}
        hint = f"did you mean {method} {calls[near[0]].path.replace('{name}', study)}"
    return f"nothing is at {path[:100]!r}; {hint}{'?' if near else '.'} The page at / describes all calls."


def _fields(endpoint: Callable[..., Any]) -> Mapping[str, Any]:
    """Return the fields of the body that an endpoint takes, by name."""
    for kind in get_type_hints(endpoint).values():
        if isinstance(kind, type) and issubclass(kind, BaseModel) and kind.model_config.get("extra") == "forbid":
            return kind.model_fields
    return {}


def _wrong_body(errors: Sequence[Any], fields: Mapping[str, Any], content_type: str, counted: bool) -> str:
    """Return what is wrong with a body, in words; not what Pydantic says, which may repeat what JSON cannot hold."""
    told = {}
    for error in errors:
        where = error["loc"][1:]
        if error["type"] in ("missing", "extra_forbidden") or not where:
            told[where, error["type"]] = _wrong_shape(error, where, fields, content_type)
        elif error["type"] == "json_invalid":
            why = error.get("ctx", {}).get("error", "it cannot be decoded")
            told[where, ""] = f"the body is no JSON ({why}, at character {where[0]}); send {_example(fields)}."
        elif where[0] == "value":
            told["value", ""] = f"value is {_shown(error['input'])}; send {_SUCCESS if counted else _VALUE}."
        elif where[0] in _VALID and len(where) > 1:
            name = "failed" if where[0] == "failed" else ".".join(map(str, where[:2]))
            told[name, ""] = f"{name} is {_shown(error['input'])}; send {_VALID[where[0]]}."
        else:
            valid = error["msg"].replace("Input should be", "it must be").replace("valid dictionary", "JSON object")
            told[where, ""] = f"{'.'.join(map(str, where))} is {_shown(error['input'])}; {valid}."
    return " ".join(told.values())


def _wrong_shape(error: Any, where: Sequence[Any], fields: Mapping[str, Any], content_type: str) -> str:
    """Return what is wrong with a body or an object in it: it is missing, no object, or lacks or has another field."""
    if where:
        name = ".".join(map(str, where))
        if error["type"] == "missing":
            return f"field '{name}' is missing; send {_example(fields)}."
        return str(unknown_name("field", name, fields)) if len(where) == 1 else f"field '{name}' is unknown."
    if error["type"] == "missing":
        return f"the body is missing; send {_example(fields)}."
    if "json" not in content_type:
        said = f"; the body was sent as {content_type[:60]!r}" if content_type else ""
        return f"the header {_JSON} is missing{said}. Send it, and the body as JSON."
    return f"the body is {_shown(error['input'])}, no JSON object; send {_example(fields)}."


def _example(fields: Mapping[str, Any]) -> str:
    """Return how a body is written that has the fields that it needs."""
    needed = [name for name, field in fields.items() if field.is_required()]
    body = "{" + ", ".join(f'"{name}": ...' for name in needed) + "}"
    others = [name for name in fields if name not in needed]
    return body + f", where wanted with {', '.join(others)}" * bool(others)


def _shown(value: Any) -> str:
    """Return a value as JSON writes it, cut where it is long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else f"{text[:60]}..."
