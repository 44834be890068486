"""optuna-dashboard on a study, with plots of ours beside its own.

The plots are not written into the study: they are handed to the dashboard with the study's attributes, and made anew,
as is the recommendation in the study's note, when trials have been finished.
"""

import copy
import threading
from collections.abc import Callable, Mapping
from socketserver import ThreadingMixIn
from typing import Any, Final
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from optuna import logging

from surehold.errors import InputError, SureholdError
from surehold.studies.robot import RobotStudy

__all__ = ["Dashboard"]

_KEY: Final = "dashboard:plot_data:{name}:{piece}"  # optuna-dashboard's format: pieces of at most 2045 characters
_LONGEST: Final = 2045

_log = logging.get_logger(__name__)


class Dashboard:
    """The dashboard of a study.

    Parameters
    ----------
    study
        The study.
    plots
        Makes the plots from it: JSON of plotly.js by name.
    pause
        Seconds between two looks whether trials have been finished.
    """

    def __init__(self, study: RobotStudy, plots: Callable[[RobotStudy], Mapping[str, str]], pause: float = 2.0):
        self._study = study
        self._make = plots
        self._pause = pause
        self._seen = -1
        self._attributes: dict[str, Any] = {}
        self._over = threading.Event()
        self._server: WSGIServer | None = None

    def application(self) -> Any:
        """Return the WSGI application."""
        from optuna_dashboard import wsgi

        return wsgi(_WithPlots(self._study, lambda: self._attributes))  # type: ignore[arg-type]

    def update(self) -> bool:
        """Make plots and recommendation anew if trials have been finished since; tell whether they have."""
        finished = [t for t in self._study.trials() if t.state.is_finished()]
        if len(finished) == self._seen:
            return False
        if any(t.values for t in finished):
            self._study.recommend()
            self._attributes = _as_attributes(self._make(self._study))
        self._seen = len(finished)
        return True

    def serve(self, host: str, port: int, ready: Callable[[str], Any] = lambda address: None) -> None:
        """Serve until Ctrl-C; `ready` is called with the address of the study's page.

        Raises
        ------
        InputError
            If the port cannot be used.
        """
        try:
            server = make_server(host, port, self.application(), _Server, _Quiet)
        except (OSError, OverflowError) as error:
            raise InputError(f"port {port} cannot be used: {getattr(error, 'strerror', None) or error}.") from None
        self._server = server
        with server:
            thread = threading.Thread(target=self._keep_updating, daemon=True)
            thread.start()
            ready(f"http://{host}:{server.server_address[1]}/dashboard/studies/{self._study.study._study_id}")
            try:
                server.serve_forever()
            finally:
                self._over.set()
                thread.join()

    def close(self) -> None:
        """End `serve`, from another thread."""
        if self._server is not None:
            self._server.shutdown()

    def _keep_updating(self) -> None:
        while True:
            try:
                self.update()
            except SureholdError as error:  # the storage is away: later, perhaps
                _log.warning(str(error))
            if self._over.wait(self._pause):
                return


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True


class _Quiet(WSGIRequestHandler):
    def log_message(self, format: str, *arguments: Any) -> None:
        """Say nothing of every request."""


class _WithPlots:
    """A storage whose study has further attributes; everything else passes through."""

    def __init__(self, study: RobotStudy, attributes: Callable[[], dict[str, Any]]):
        self._backend = study.storage.backend
        self._name = study.name
        self._more = attributes

    @property
    def __class__(self) -> Any:  # type: ignore[override]  # a transparent proxy: it is an instance of what the backend is an instance of
        return type(self._backend)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def get_all_studies(self) -> list[Any]:
        """Return all studies, ours with the further attributes."""
        studies = []
        for study in self._backend.get_all_studies():
            if study.study_name == self._name:
                study = copy.copy(study)
                study.system_attrs = study.system_attrs | self._more()
            studies.append(study)
        return studies


def _as_attributes(plots: Mapping[str, str]) -> dict[str, str]:
    return {
        _KEY.format(name=name, piece=i // _LONGEST): text[i : i + _LONGEST]
        for name, text in plots.items()
        for i in range(0, len(text), _LONGEST)
    }
