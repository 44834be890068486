"""What the HTTP service answers to mistakes: what is wrong with a request, and what to send instead."""

from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Final, get_type_hints

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from surehold.errors import InputError, SureholdError
from surehold.studies.ledger import AnswerRefused, UnknownTrial
from surehold.studies.robot import NothingToAsk
from surehold.studies.service_bodies import NamedTwice
from surehold.studies.storage import StorageFailure
from surehold.studies.wrong_fields import example, shown, wrong_field

__all__ = ["say_what_is_wrong"]

_JSON: Final = "'Content-Type: application/json'"


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
        if error.status_code == 400 and not isinstance(error, NamedTwice):  # FastAPI says that there was an error
            detail = "the body cannot be read as JSON: too deep, a number of too many digits, or no text in UTF-8."
        elif error.status_code == 404 and detail == "Not Found":
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
    """Return what is wrong with a body, in words."""
    told = {}
    for error in errors:
        where = error["loc"][1:]
        if not where:
            told[where, error["type"]] = _no_object(error, fields, content_type)
        elif error["type"] == "json_invalid":
            why = error.get("ctx", {}).get("error", "it cannot be decoded")
            told[where, ""] = f"the body is no JSON ({why}, at character {where[0]}); send {example(fields)}."
        else:
            field, words = wrong_field(error, where, fields, counted)
            told[field] = words
    return " ".join(told.values())


def _no_object(error: Any, fields: Mapping[str, Any], content_type: str) -> str:
    """Return what is wrong with a body that is missing or no object."""
    if error["type"] == "missing":
        return f"the body is missing; send {example(fields)}."
    if "json" not in content_type:
        said = f"; the body was sent as {content_type[:60]!r}" if content_type else ""
        return f"the header {_JSON} is missing{said}. Send it, and the body as JSON."
    return f"the body is {shown(error['input'])}, no JSON object; send {example(fields)}."
