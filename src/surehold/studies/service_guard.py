"""What stands before the HTTP service: whom it answers, how much it reads, and how long it waits.

In this order, before anything of the request's body is read: the Host header must name this machine (a web page whose
name was turned to the loopback address sends its own), the token must be right, the body must not be declared too
large. Then the body is read whole, within a time limit. Whoever is slower than that at sending the head of a request,
or at reading an answer, loses the connection.
"""

import asyncio
import hmac
import time
from contextlib import suppress
from typing import Any, Final

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["LARGEST_BODY", "OPEN_PATHS", "PATIENCE", "Guard", "Impatience"]

LARGEST_BODY: Final = 64 * 1024  # bytes
PATIENCE: Final = 10.0  # seconds for the head of a request, for its body, and between two reads of an answer
OPEN_PATHS: Final = ("/", "/health", "/openapi.json")  # answered without the token; they say nothing of the study
_LINGER, _DROPPED = 2.0, 1024 * 1024  # seconds and bytes for which a refused request is listened to, and dropped
_HOSTS: Final = ("127.0.0.1", "localhost", "[::1]")


class Guard:
    """The application `app` for those who send the token, in requests of a reasonable size and speed."""

    def __init__(self, app: ASGIApp, token: str, patience: float = PATIENCE):
        self._app = app
        self._token = token.encode()
        self._patience = patience

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope["path"], Headers(scope=scope))
        messages: list[Message] = []
        if refusal is None:
            try:
                async with asyncio.timeout(self._patience):
                    refusal = await _read(receive, messages)
            except TimeoutError:
                refusal = _refused(408, f"the body did not arrive within {self._patience:g} s.")
        if refusal is not None:
            await self._refuse(refusal, scope, receive, send)
            return

        async def replay() -> Message:
            return messages.pop(0) if messages else await receive()

        await self._app(scope, replay, send)

    async def _refuse(self, refusal: JSONResponse, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer at once, then drop a little of what is still arriving.

        A caller in the middle of sending, whose connection is closed under it, would hear a reset and no answer.
        """

        async def begin(message: Message) -> None:
            await send({**message, "more_body": True} if message["type"] == "http.response.body" else message)

        await refusal(scope, receive, begin)
        dropped = 0
        with suppress(TimeoutError):
            async with asyncio.timeout(min(_LINGER, self._patience)):
                while dropped < _DROPPED:
                    message = await receive()
                    dropped += len(message.get("body", b""))
                    if not message.get("more_body", False):
                        break
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    def _refusal(self, path: str, headers: Headers) -> JSONResponse | None:
        host = headers.get("host", "")
        if host.rpartition(":")[0] not in _HOSTS and host not in _HOSTS:
            return _refused(
                400, f"the Host header names {host[:100]!r}, not this machine; send 127.0.0.1 or localhost."
            )
        kind, _, given = headers.get("authorization", "").partition(" ")
        if path not in OPEN_PATHS and not (
            kind.lower() == "bearer" and hmac.compare_digest(given.strip().encode(), self._token)
        ):
            return _refused(401, "the token is missing or wrong; send the header 'Authorization: Bearer TOKEN'.")
        declared = headers.get("content-length", "0")
        if not declared.isdigit() or len(declared) > 18 or int(declared) > LARGEST_BODY:
            return _TOO_LARGE
        return None


async def _read(receive: Receive, messages: list[Message]) -> JSONResponse | None:
    """Append the messages of a body; returns a refusal where it is too large, with the rest of it unread."""
    size, more = 0, True
    while more:
        message = await receive()
        messages.append(message)
        size += len(message.get("body", b""))
        if size > LARGEST_BODY:
            return _TOO_LARGE
        more = message["type"] == "http.request" and message.get("more_body", False)
    return None


def _refused(code: int, detail: str) -> JSONResponse:
    headers = {"Connection": "close"} | ({"WWW-Authenticate": "Bearer"} if code == 401 else {})
    return JSONResponse({"detail": detail}, code, headers)


_TOO_LARGE: Final = _refused(413, f"the body is larger than {LARGEST_BODY} bytes.")


class Impatience:
    """Closes the connections of a uvicorn server that wait for their caller for longer than `patience` seconds.

    A connection waits where no request is under way (nothing, or half of a head, has arrived), or where the buffers
    behind an answer are full. To be called now and then.
    """

    def __init__(self, patience: float):
        self._patience = patience
        self._waiting: dict[Any, tuple[Any, float]] = {}

    def __call__(self, connections: set[Any]) -> None:
        """Look at all connections; closes those that have waited for too long."""
        now = time.monotonic()
        before, self._waiting = self._waiting, {}
        for connection in list(connections):
            cycle = connection.cycle
            under_way = cycle is not None and not cycle.response_complete
            if under_way and not connection.flow.write_paused:
                continue
            request, since = before.get(connection, (cycle, now))
            if request is not cycle:
                since = now
            self._waiting[connection] = (cycle, since)
            if now - since > self._patience:
                connection.transport.abort()  # not close(): that waits until the buffers are read
