"""What a part of surehold needs beyond the core, and one clear line where that is not installed."""

from importlib.util import find_spec
from typing import Final

from surehold.errors import InputError

__all__ = ["EXTRAS", "MissingExtra", "require"]

#: extra -> the modules that its distributions (pyproject.toml) bring and that the part imports
EXTRAS: Final[dict[str, tuple[str, ...]]] = {
    "grasp": ("trimesh", "manifold3d", "pydantic", "yaml"),
    "cli": ("typer", "rich"),
    "report": ("matplotlib", "jinja2"),
    "campaign": ("joblib", "pydantic", "yaml", "filelock"),
    "study": ("optuna", "optuna_dashboard", "psycopg", "fastapi", "uvicorn", "pydantic", "filelock"),
    "mujoco": ("mujoco",),
    "mesh": ("igl",),
    "sklearn": ("sklearn",),
    "dask": ("distributed",),
}


class MissingExtra(InputError, ImportError):
    """A part of surehold needs packages that are not installed; the message gives the command that installs them."""


def require(extra: str, part: str) -> None:
    """Raise MissingExtra if a module of the extra is not installed; `part` names what needs it. Imports nothing."""
    missing = [module for module in EXTRAS[extra] if find_spec(module) is None]
    if missing:
        raise MissingExtra(
            f"{part} needs {', '.join(missing)}, not installed here; run: pip install 'surehold[{extra}]'."
        )
