"""The HTTP service of a study, with nothing but Python's standard library: the robot's Python needs no surehold.

Requests are repeated while the service cannot be reached: asking again and telling again are harmless.
"""

import json
import time
from collections.abc import Mapping
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import quote
from urllib.request import Request, urlopen


class Refused(Exception):
    """The service understood and refused; `code` is its HTTP status (409: paused, stopped or told otherwise before)."""

    def __init__(self, code: int, message: str):
        super().__init__(message)
        self.code = code


class StudyClient:
    """A study served at `address`, such as http://127.0.0.1:8765."""

    def __init__(self, address: str, study: str, token: str, patience: float = 60.0):
        self._root = f"{address.rstrip('/')}/studies/{quote(study)}"
        self._token = token
        self._patience = patience

    def ask(self, worker: str) -> dict[str, Any]:
        """Return the next trial {id, parameters, units, again}; the same one until the worker has told it."""
        return self._send("ask", {"worker": worker})

    def tell(
        self, id: int, value: float | None, *, failed: bool = False, reached: Mapping[str, float] | None = None
    ) -> dict[str, Any]:
        """Tell what came of a trial; returns {id, state, value, already}."""
        answer: dict[str, Any] = {"id": id, "failed": failed}
        if not failed:
            answer["value"] = value
        if reached:
            answer["reached"] = dict(reached)
        return self._send("tell", answer)

    def recommendation(self) -> dict[str, Any]:
        """Return what still holds when the robot is off {parameters, mean, quantile, ...}."""
        return self._send("recommendation", None)

    def _send(self, what: str, body: dict[str, Any] | None) -> dict[str, Any]:
        data = None if body is None else json.dumps(body, allow_nan=False).encode()
        headers = {"Authorization": f"Bearer {self._token}", "Content-Type": "application/json"}
        request = Request(f"{self._root}/{what}", data, headers)
        end = time.monotonic() + self._patience
        while True:
            try:
                with urlopen(request, timeout=60.0) as answer:
                    return json.load(answer)
            except HTTPError as error:
                with error:
                    detail = json.loads(error.read() or b"{}").get("detail", error.reason)
                if error.code != 503 or time.monotonic() > end:
                    raise Refused(error.code, str(detail)) from None
            except (URLError, TimeoutError, ConnectionError):
                if time.monotonic() > end:
                    raise
            time.sleep(0.5)
