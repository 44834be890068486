"""What goes over the wire of the HTTP service, and of what kinds the arguments of the tools for language models are.

Unknown fields, text in place of numbers, and numbers that are not finite are refused.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

__all__ = [
    "Added",
    "Addition",
    "Answer",
    "AskedTrial",
    "Count",
    "Id",
    "NextTrial",
    "Outputs",
    "Parameters",
    "Problem",
    "Question",
    "Reason",
    "State",
    "Taken",
    "Value",
    "Veto",
]


def _whole(value: Any) -> Any:
    """Return 7 for 7.0: to JSON they are the same number."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Id = Annotated[int, BeforeValidator(_whole), Field(ge=0, le=2**31 - 1, description="Of the trial, as ask gave it.")]
_Text = Annotated[str, Field(max_length=500)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
Value = Annotated[
    bool | _Finite | Literal["success", "failure"] | None,
    Field(description="Outcome; of success: true or success, false or failure."),
]
Count = Annotated[
    int | None, BeforeValidator(_whole), Field(description="In place of value: successes, of so many executions.")
]
Outputs = Annotated[dict[str, _Finite | None] | None, Field(description="Further outputs by name.")]
Parameters = dict[str, int | _Finite | str | bool | None]


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Question(_Request):
    """Who asks."""

    worker: Annotated[
        str | None,
        Field(max_length=200, description="Who makes the trial; asked again before it was told, gets the same trial."),
    ] = None


class TouchPoint(_Request):
    """Where a hand touched."""

    point: Annotated[list[_Finite], Field(min_length=3, max_length=3, description="In the object's frame, m.")]
    normal: Annotated[list[_Finite], Field(min_length=3, max_length=3, description="Unit length, out of the object.")]


class Touches(_Request):
    """What a trial told of the shape."""

    contacts: Annotated[list[TouchPoint], Field(max_length=400)]
    free: Annotated[
        list[Annotated[list[_Finite], Field(min_length=4, max_length=4)]],
        Field(max_length=400, description="x, y, z, radius: space without the object."),
    ] = Field(default_factory=list)


class Answer(_Request):
    """What came of a trial."""

    id: Id
    value: Value = None
    failed: Annotated[bool | Literal["rig"], Field(description='"rig": not the place failed; it is asked again.')] = (
        False
    )
    reached: Annotated[Parameters | None, Field(description="What was truly reached, where it differs.")] = None
    constraints: Outputs = None
    successes: Count = None
    of: Count = None
    touches: Annotated[Touches | None, Field(description="Of a study about an unknown shape.")] = None


class Addition(_Request):
    """A trial that was made by hand."""

    parameters: Parameters
    value: Value = None
    failed: bool = False
    reached: Parameters | None = None
    constraints: Outputs = None
    successes: Count = None
    of: Count = None


class Veto(_Request):
    """A trial that must not be made."""

    id: Id
    reason: _Text = ""


class Reason(_Request):
    """Why."""

    reason: _Text = ""


class AskedTrial(BaseModel):
    """A trial to be made."""

    id: int
    parameters: dict[str, Any]
    units: dict[str, str]
    again: bool
    pose: dict[str, Any] | None = None
    behind: Annotated[int, Field(description="Told answers that its model did not know; 0 unless asks overlap.")] = 0


class Taken(BaseModel):
    """An answer that was stored."""

    id: int
    state: str
    value: float | None
    already: bool
    of: int = 1


class Added(BaseModel):
    """A trial that was stored."""

    id: int


class NextTrial(BaseModel):
    """What would be asked next."""

    parameters: dict[str, Any]
    expected_improvement: float | None


class State(BaseModel):
    """Of a study, after a ruling."""

    name: str
    state: str


class Problem(BaseModel):
    """What was wrong, and what to do."""

    detail: str
