"""A study as a server of the Model Context Protocol: a language model asks, tells and reads the answer by tools.

The same words as over HTTP (`studies.service`), on the standard input and output of the process that the host started.
"""

from collections.abc import Callable
from typing import Any, Literal

from surehold import __version__
from surehold.extras import require
from surehold.studies.robot import RobotStudy
from surehold.studies.status import rows, status

try:
    from mcp.server import MCPServer
    from mcp.server.mcpserver.exceptions import ToolError
    from mcp.server.mcpserver.tools import Tool
    from pydantic import ConfigDict, ValidationError
except ImportError:
    require("mcp", "surehold.studies.model_context")
    raise

from surehold.errors import SureholdError
from surehold.studies import service_messages as wire
from surehold.studies.wrong_fields import wrong_field

__all__ = ["model_context_server"]

_INSTRUCTIONS = """Study '{name}' looks for parameters whose outcome is good and stays good when the input is off. Make
trials in turn: ask, try the parameters in the real world, tell the value ({direction} it) or that the trial failed.
Never invent a value. `recommend` gives the answer that holds, which is mostly not the best value observed."""


def model_context_server(study: RobotStudy) -> MCPServer:
    """Return a server with the tools ask, tell, recommend, next_trial, add, status and trials, for one study.

    What a study refuses is the error of the tool, in the same words as everywhere.
    """

    def answered(do: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return do(*arguments, **named)
        except SureholdError as error:
            raise ToolError(str(error)) from None

    def ask(worker: str | None = None) -> dict[str, Any]:
        """Hand out the next trial: its id, parameters and units. The same worker gets one trial until it is told."""
        asked = answered(study.ask, worker)
        found = {"id": asked.id, "parameters": asked.parameters, "units": asked.units, "again": asked.again}
        return found | ({} if asked.pose is None else {"pose": asked.pose})

    def tell(
        id: wire.Id,
        value: wire.Value = None,
        failed: bool | Literal["rig"] = False,
        reached: wire.Parameters | None = None,
        constraints: wire.Outputs = None,
        contacts: dict[str, Any] | None = None,
        successes: wire.Count = None,
        of: wire.Count = None,
    ) -> dict[str, Any]:
        """Say what came of a trial: its value, or that it failed; `reached` are the parameters truly reached.

        "rig" as `failed`: the parameters are not at fault. `constraints` are the further outputs {name: value} of a
        study that has limits, `contacts` what the hand touched in one of an unknown shape. Where the study is about
        success the value is success or failure; or tell successes of so many executions.
        """
        said = {"failed": failed, "reached": reached, "constraints": constraints, "contacts": contacts}
        told = answered(study.tell, id, value, **said, successes=successes, of=of)
        return {"id": told.id, "state": told.state, "value": told.value, "already": told.already, "of": told.of}

    def recommend() -> dict[str, Any]:
        """Return the trial that still holds when the input is off, with what to expect of it."""
        return answered(study.recommend).as_dict() | {"units": dict(study.settings.units)}

    def next_trial() -> dict[str, Any]:
        """Return what would be asked next, and the improvement expected of it, without asking."""
        return {"parameters": answered(study.next), "expected_improvement": answered(study.promise)}

    def add(
        parameters: wire.Parameters,
        value: wire.Value = None,
        failed: bool = False,
        reached: wire.Parameters | None = None,
        constraints: wire.Outputs = None,
        successes: wire.Count = None,
        of: wire.Count = None,
    ) -> dict[str, Any]:
        """Store a trial that was made without being asked for; its outcome as of tell."""
        said = {"failed": failed, "reached": reached, "constraints": constraints}
        return {"id": answered(study.add, parameters, value, **said, successes=successes, of=of)}

    def state() -> dict[str, Any]:
        """Return the state of the study, its parameters, input noise, and the trials under way."""
        return answered(status, study)

    def trials() -> dict[str, Any]:
        """Return all trials."""
        return {"trials": answered(rows, study)}

    counted = study.settings.optimizer.get("outcome") == "success"
    return MCPServer(
        f"surehold study {study.name}",
        instructions=_INSTRUCTIONS.format(name=study.name, direction=study.settings.direction),
        version=__version__,
        tools=[_tool(do, counted) for do in (ask, tell, recommend, next_trial, add, state, trials)],
        log_level="WARNING",
    )


class _Tool(Tool):
    """A tool that says in words what is wrong with its arguments, and nothing before what a study refuses."""

    counted: bool
    """whether the study is about success"""

    async def run(self, *arguments: Any, **named: Any) -> Any:
        try:
            return await super().run(*arguments, **named)
        except ToolError as error:
            cause = error.__cause__
            if isinstance(cause, ToolError):
                raise cause from None
            if not isinstance(cause, ValidationError):
                raise
            fields = self.fn_metadata.arg_model.model_fields
            wrong = (wrong_field(found, found["loc"], fields, self.counted) for found in cause.errors())
            raise ToolError(" ".join(dict(wrong).values())) from None


def _tool(do: Callable[..., Any], counted: bool) -> Tool:
    """Return a function as a tool that refuses unknown arguments, and texts in place of numbers."""
    made = Tool.from_function(do, name="status" if do.__name__ == "state" else None)
    parsed = made.fn_metadata.arg_model
    strict = type(parsed.__name__, (parsed,), {"model_config": ConfigDict(extra="forbid", strict=True)})
    made.fn_metadata.arg_model = strict
    return _Tool(**dict(made) | {"parameters": strict.model_json_schema(by_alias=True), "counted": counted})
