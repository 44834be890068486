"""A study over HTTP, on the loopback interface: for robot controllers and ROS nodes in any language.

Every request carries the token (`Authorization: Bearer TOKEN`). What is answered has been stored before. Mistakes of
the caller are answered with 4xx and `{"detail": what is wrong and what to do}`; only a storage that is away with 503.
"""

import html
import secrets
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Annotated, Any, Final

from fastapi import Depends, FastAPI, HTTPException, Path
from fastapi.responses import HTMLResponse
from fastapi.security import HTTPBearer

from surehold import __version__
from surehold.errors import InputError
from surehold.studies import service_messages as wire
from surehold.studies.prepared import Prepared
from surehold.studies.robot import RobotStudy
from surehold.studies.service_bodies import BodyRoute
from surehold.studies.service_guard import PATIENCE, Guard, Impatience
from surehold.studies.service_mistakes import say_what_is_wrong
from surehold.studies.status import rows, status

__all__ = ["HOST", "Server", "listening", "new_token", "service"]

HOST: Final = "127.0.0.1"

_bearer = HTTPBearer(auto_error=False, description="The token that `surehold study serve` printed.")  # for the page


def new_token() -> str:
    """Return a token that nobody can guess."""
    return secrets.token_urlsafe(24)


class Server:
    """A port of the loopback interface that is listened to; `address` is its URL."""

    def __init__(self, listener: socket.socket):
        self._listener = listener
        self.address: Final = f"http://{HOST}:{listener.getsockname()[1]}"

    def run(self, application: FastAPI, patience: float = PATIENCE) -> None:
        """Answer requests until Ctrl-C or SIGTERM; callers that take longer than `patience` seconds are dropped."""
        import uvicorn

        impatience = Impatience(patience)

        async def look() -> None:
            impatience(server.server_state.connections)

        configuration = uvicorn.Config(
            application,
            http="h11",
            ws="none",
            log_level="warning",
            access_log=False,
            callback_notify=look,
            timeout_notify=min(1, patience),  # type: ignore[arg-type]
        )
        server = uvicorn.Server(configuration)
        server.run(sockets=[self._listener])


@contextmanager
def listening(port: int) -> Iterator[Server]:
    """Listen to a port, 0 for a free one; raises InputError if it is taken or none."""
    try:
        listener = socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        raise InputError(f"port {port} cannot be used: {getattr(error, 'strerror', None) or error}.") from None
    with listener:
        yield Server(listener)


def service(study: RobotStudy, token: str, patience: float = PATIENCE) -> FastAPI:
    """Return the application that answers for one study.

    Raises
    ------
    InputError
        If the token is shorter than 16 characters, or could not stand in a header.
    """
    if len(token) < 16 or not token.isascii() or not token.isprintable() or " " in token:
        raise InputError("the token must be 16 printable ASCII characters or more, without spaces.")

    def served(name: Annotated[str, Path(json_schema_extra={"enum": [study.name]})]) -> None:
        if name != study.name:
            raise HTTPException(404, f"study {name[:100]!r} is not served here; this is '{study.name}'.")

    prepared = Prepared(study)

    @asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        yield
        prepared.close()

    problems: dict[int | str, dict[str, Any]] = {
        code: {"model": wire.Problem} for code in (400, 401, 404, 408, 409, 413, 422, 503)
    }
    app = FastAPI(
        title=f"surehold study {study.name}",
        version=__version__,
        description=__doc__ or "",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        responses=problems,
        lifespan=life,
    )
    app.router.route_class = BodyRoute
    app.add_middleware(Guard, token=token, patience=patience)
    say_what_is_wrong(app, study.name, study.settings.optimizer.get("outcome") == "success")
    writing = threading.Lock()  # one recommendation is written at a time
    protected: dict[str, Any] = {"dependencies": [Depends(_bearer), Depends(served)]}  # Guard has checked the token

    @app.get("/", response_class=HTMLResponse, include_in_schema=False)
    def page() -> str:
        return _page(app)

    @app.get("/health")
    def health() -> dict[str, bool]:
        """Tell that the service is alive; needs no token."""
        return {"alive": True}

    @app.get("/studies/{name}/status", **protected)
    def state() -> dict[str, Any]:
        """Return the state of the study, and the trials under way."""
        return status(study)

    @app.post("/studies/{name}/ask", **protected)
    def ask(question: wire.Question) -> wire.AskedTrial:
        """Hand out the next trial; where asks overlap, one that was prepared ahead."""
        return wire.AskedTrial(**vars(prepared.ask(question.worker)))

    @app.post("/studies/{name}/tell", **protected)
    def tell(answer: wire.Answer) -> wire.Taken:
        """Take what came of a trial; the same answer twice is harmless."""
        told = study.tell(
            answer.id,
            answer.value,
            failed=answer.failed,
            reached=answer.reached,
            constraints=answer.constraints,
            contacts=None if answer.touches is None else answer.touches.model_dump(),
            successes=answer.successes,
            of=answer.of,
        )
        return wire.Taken(id=told.id, state=told.state, value=told.value, already=told.already, of=told.of)

    @app.get("/studies/{name}/recommendation", **protected)
    def recommendation() -> dict[str, Any]:
        """Return the trial that still holds when the input is off, and note it in the study."""
        with writing:
            return study.recommend().as_dict() | {"units": dict(study.settings.units)}

    @app.get("/studies/{name}/next", **protected)
    def next_trial() -> wire.NextTrial:
        """Return what would be asked next, without asking."""
        return wire.NextTrial(parameters=study.next(), expected_improvement=study.promise())

    @app.get("/studies/{name}/trials", **protected)
    def trials() -> list[dict[str, Any]]:
        """Return all trials."""
        return rows(study)

    @app.post("/studies/{name}/add", **protected)
    def add(addition: wire.Addition) -> wire.Added:
        """Add a trial that was made by hand."""
        id = study.add(
            addition.parameters,
            addition.value,
            failed=addition.failed,
            reached=addition.reached,
            constraints=addition.constraints,
            successes=addition.successes,
            of=addition.of,
        )
        return wire.Added(id=id)

    @app.post("/studies/{name}/veto", **protected)
    def veto(veto: wire.Veto) -> wire.Added:
        """Forbid a trial that was handed out."""
        study.veto(veto.id, veto.reason)
        return wire.Added(id=veto.id)

    @app.post("/studies/{name}/pause", **protected)
    def pause(reason: wire.Reason) -> wire.State:
        """Hand out nothing until resumed."""
        study.pause(reason.reason)
        return wire.State(name=study.name, state="paused")

    @app.post("/studies/{name}/resume", **protected)
    def resume() -> wire.State:
        """Hand out trials again."""
        study.resume()
        return wire.State(name=study.name, state="open")

    return app


def _page(app: FastAPI) -> str:
    """Return the OpenAPI description as a page that needs no network."""
    described = app.openapi()
    lines = [
        f"<h1>{html.escape(described['info']['title'])}</h1>",
        f"<p>{html.escape(described['info']['description'])}</p>",
    ]
    lines.append('<p>As <a href="openapi.json">openapi.json</a>, for machines.</p><dl>')
    schemas = described["components"]["schemas"]
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            lines.append(f"<dt><code>{method.upper()} {html.escape(path)}</code></dt>")
            lines.append(f"<dd>{html.escape(operation['description'])}{_fields(operation, schemas)}</dd>")
    style = "body{font:16px/1.5 sans-serif;max-width:50em;margin:2em auto;padding:0 1em}dt{margin-top:1em}"
    return f"<!doctype html><meta charset=utf-8><title>surehold</title><style>{style}</style>{''.join(lines)}</dl>"


def _fields(operation: dict[str, Any], schemas: dict[str, Any]) -> str:
    body = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    if "$ref" not in body:
        return ""
    schema = schemas[body["$ref"].rsplit("/", 1)[-1]]
    required = schema.get("required", [])
    names = [f"{name}{'' if name in required else ' (optional)'}" for name in schema["properties"]]
    return f" <br>Body: <code>{html.escape(', '.join(names))}</code>"
