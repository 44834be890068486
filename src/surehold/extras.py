"""What a part of surehold needs beyond the core, and one clear line where that is not installed."""

from importlib.util import find_spec
from typing import Final

from surehold.errors import InputError

__all__ = ["EXTRAS", "MODULES", "MissingExtra", "missing", "require"]

#: extra -> the distributions that it brings, as in pyproject.toml
EXTRAS: Final[dict[str, tuple[str, ...]]] = {
    "grasp": ("trimesh", "manifold3d", "pydantic", "PyYAML"),
    "cli": ("typer", "rich"),
    "report": ("matplotlib", "jinja2"),
    "campaign": ("pydantic", "PyYAML"),
    "study": ("optuna", "optuna-dashboard", "psycopg", "fastapi", "uvicorn", "pydantic"),
    "mujoco": ("mujoco",),
    "mesh": ("libigl",),
    "sklearn": ("scikit-learn",),
    "gest": ("gest-api",),
    "mcp": ("mcp",),
    "dask": ("dask",),
}
#: module of a distribution, where the names differ
MODULES: Final[dict[str, str]] = {
    "PyYAML": "yaml",
    "dask": "distributed",
    "gest-api": "gest_api",
    "libigl": "igl",
    "optuna-dashboard": "optuna_dashboard",
    "scikit-learn": "sklearn",
}


class MissingExtra(InputError, ImportError):
    """A part of surehold needs packages that are not installed; the message gives the command that installs them."""


def missing(extra: str) -> list[str]:
    """Return the distributions of an extra that are not installed. Imports nothing."""
    return [name for name in EXTRAS[extra] if find_spec(MODULES.get(name, name)) is None]


def require(extra: str, part: str) -> None:
    """Raise MissingExtra if a distribution of the extra is not installed; `part` names what needs it."""
    if names := ", ".join(missing(extra)):
        raise MissingExtra(f"{part} needs {names}, not installed here; run: pip install 'surehold[{extra}]'.")
