"""How the HTTP service reads a body: a name that stands twice in an object is refused, of which JSON keeps the last."""

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

__all__ = ["BodyRoute", "NamedTwice"]


class NamedTwice(HTTPException):
    """An object of the body has two values of one name."""

    def __init__(self, name: str):
        super().__init__(400, f"the body names {name[:60]!r} twice; send each name once.")


class BodyRoute(APIRoute):
    """A call whose body is read so."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers the call; see FastAPI."""
        handler = super().get_route_handler()

        async def answer(request: Request) -> Response:
            return await handler(_Request(request.scope, request.receive))

        return answer


class _Request(Request):
    async def json(self) -> Any:
        return json.loads(await self.body(), object_pairs_hook=_object)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise NamedTwice(name)
        found[name] = value
    return found
