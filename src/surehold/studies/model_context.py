"""A study as a server of the Model Context Protocol: a language model asks, tells and reads the answer by tools.

The same words as over HTTP (`studies.service`), on the standard input and output of the process that the host started.
"""

from typing import Any, Literal

from surehold import __version__
from surehold.extras import require
from surehold.studies.robot import RobotStudy
from surehold.studies.status import rows, status

try:
    from mcp.server import MCPServer
    from mcp.server.mcpserver.exceptions import ToolError
except ImportError:
    require("mcp", "surehold.studies.model_context")
    raise

from surehold.errors import SureholdError

__all__ = ["model_context_server"]

_Value = float | Literal["success", "failure"] | None

_INSTRUCTIONS = """Study '{name}' looks for parameters whose outcome is good and stays good when the input is off. Make
trials in turn: ask, try the parameters in the real world, tell the value ({direction} it) or that the trial failed.
Never invent a value. `recommend` gives the answer that holds, which is mostly not the best value observed."""


def model_context_server(study: RobotStudy) -> MCPServer:
    """Return a server with the tools ask, tell, recommend, next_trial, add, status and trials, for one study.

    What a study refuses is the error of the tool, in the same words as everywhere.
    """
    server = MCPServer(
        f"surehold study {study.name}",
        instructions=_INSTRUCTIONS.format(name=study.name, direction=study.settings.direction),
        version=__version__,
        log_level="WARNING",
    )

    def answered(do: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return do(*arguments, **named)
        except SureholdError as error:
            raise ToolError(str(error)) from None

    @server.tool()
    def ask(worker: str | None = None) -> dict[str, Any]:
        """Hand out the next trial: its id, parameters and units. The same worker gets one trial until it is told."""
        asked = answered(study.ask, worker)
        return {"id": asked.id, "parameters": asked.parameters, "units": asked.units, "again": asked.again}

    @server.tool()
    def tell(
        id: int,
        value: _Value = None,
        failed: bool | Literal["rig"] = False,
        reached: dict[str, Any] | None = None,
        constraints: dict[str, float | None] | None = None,
        contacts: dict[str, Any] | None = None,
        successes: int | None = None,
        of: int | None = None,
    ) -> dict[str, Any]:
        """Say what came of a trial: its value, or that it failed; `reached` are the parameters truly reached.

        "rig" as `failed`: the parameters are not at fault. `constraints` are the further outputs {name: value} of a
        study that has limits, `contacts` what the hand touched in one of an unknown shape. Where the study is about
        success the value is success or failure; or tell successes of so many executions.
        """
        said = {"failed": failed, "reached": reached, "constraints": constraints, "contacts": contacts}
        told = answered(study.tell, id, value, **said, successes=successes, of=of)
        return {"id": told.id, "state": told.state, "value": told.value, "already": told.already, "of": told.of}

    @server.tool()
    def recommend() -> dict[str, Any]:
        """Return the trial that still holds when the input is off, with what to expect of it."""
        return answered(study.recommend).as_dict() | {"units": dict(study.settings.units)}

    @server.tool()
    def next_trial() -> dict[str, Any]:
        """Return what would be asked next, and the improvement expected of it, without asking."""
        return {"parameters": answered(study.next), "expected_improvement": answered(study.promise)}

    @server.tool()
    def add(
        parameters: dict[str, Any],
        value: _Value = None,
        failed: bool = False,
        reached: dict[str, Any] | None = None,
        constraints: dict[str, float | None] | None = None,
        successes: int | None = None,
        of: int | None = None,
    ) -> dict[str, Any]:
        """Store a trial that was made without being asked for; its outcome as of tell."""
        said = {"failed": failed, "reached": reached, "constraints": constraints}
        return {"id": answered(study.add, parameters, value, **said, successes=successes, of=of)}

    @server.tool(name="status")
    def state() -> dict[str, Any]:
        """Return the state of the study, its parameters, input noise, and the trials under way."""
        return answered(status, study)

    @server.tool()
    def trials() -> dict[str, Any]:
        """Return all trials."""
        return {"trials": answered(rows, study)}

    return server
