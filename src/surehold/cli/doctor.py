"""`surehold doctor`: what is installed, where caches lie, what is compiled, and whether pictures can be rendered."""

import importlib
import os
import pkgutil
import platform
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from surehold.amounts import amount

__all__ = ["doctor"]

CORE = ("numpy", "scipy", "numba", "threadpoolctl", "lazy_loader", "filelock", "joblib")


def doctor(
    warm: Annotated[
        bool, typer.Option("--warm", help="Compile all kernels into the cache first, as for a container image.")
    ] = False,
) -> None:
    """Show versions, caches, compiled kernels and graphics libraries."""
    if warm:
        _warm()
    from rich.console import Console
    from rich.table import Table

    from surehold import __version__
    from surehold.extras import EXTRAS, missing

    table = Table(show_edge=False, pad_edge=False, show_header=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    table.add_row("surehold", __version__)
    table.add_row("Python", f"{platform.python_version()} on {platform.platform()}")
    table.add_row("cores", str(os.cpu_count()))
    for name in CORE:
        table.add_row(name, version_of(name) or "MISSING: pip install surehold")
    for extra, names in EXTRAS.items():
        absent = missing(extra)
        advice = f"; without {', '.join(absent)}: pip install 'surehold[{extra}]'" if absent else ""
        have = ", ".join(f"{name} {version_of(name)}" for name in names if name not in absent)
        table.add_row(f"extra {extra}", f"{have or 'not installed'}{advice}", style="dim" if absent else None)
    compiled, total = compiled_kernels()
    table.add_row("compiled kernels", f"{compiled} of {total} are in the cache; others are compiled when first used")
    folders = kernel_folders()
    table.add_row(
        "kernel cache", f"{amount(len(folders), 'folder')} in {os.path.commonpath(folders)}" if folders else "none"
    )
    if not missing("grasp"):
        table.add_row("data cache", data_cache())
    for name, found in graphics_libraries().items():
        table.add_row(name, found or "not found; only needed for still pictures by MuJoCo")
    Console(highlight=False, markup=False).print(table)


def _warm() -> None:
    """Compile what any named surrogate, strategy and grasp needs; what is in the cache takes a second."""
    from surehold.cli.terminal import terminal
    from surehold.extras import missing
    from surehold.optimization.compilation import compile_now
    from surehold.optimization.noise.input_noise import InputNoise
    from surehold.optimization.success import SUCCESS_SURROGATES
    from surehold.optimization.surrogates.named import SURROGATES

    console = terminal()
    noise = InputNoise.unit(0.05)
    paths: list[dict[str, Any]] = [{}, {"input_noise": noise}]
    paths += [{"surrogate": name} for name in SURROGATES]
    paths += [{"surrogate": name, "input_noise": noise} for name in SURROGATES]
    paths += [
        {"noise": "inferred"},
        {"noise": "heteroscedastic"},
        {"criterion": "thompson"},
        {"criterion": "ei"},
        {"risk": "cvar", "input_noise": noise},
        {"preset": "thesis", "input_noise": noise},
        *({"outcome": "success", "surrogate": name, "input_noise": noise} for name in SUCCESS_SURROGATES),
    ]
    for number, path in enumerate(paths):
        named = ", ".join(map(str, path.values())) or "the defaults"
        console.print(f"Compiling {number + 1} of {len(paths)}: {named}", markup=False)
        compile_now(path)
    if not missing("grasp"):
        from surehold.grasping import CONTACT_MODELS
        from surehold.problems import GraspProblem

        for contact in CONTACT_MODELS:
            console.print(f"Compiling grasps: {contact}", markup=False)
            GraspProblem("mug", contact=contact).warm_up()


def version_of(name: str) -> str | None:
    """Return the installed version of a distribution, or None."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def compiled_kernels() -> tuple[int, int]:
    """Return how many of the project's kernels have compiled code in the cache, and how many there are."""
    indices = [index for index, _ in _kernels()]
    return sum(index.is_file() for index in indices), len(indices)


def kernel_folders() -> set[Path]:
    """Return the folders that hold compiled kernels."""
    return {folder for _, folder in _kernels()}


def data_cache() -> str:
    """Return the folder of computed data, such as distance fields, and what it holds."""
    from surehold.grasping.object.distance_field import cache_folder

    folder = cache_folder()
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    return f"{folder}: {amount(len(sizes), 'file')}, {sum(sizes) / 1e6:.1f} MB"


def graphics_libraries() -> dict[str, str | None]:
    """Return EGL, OSMesa and OpenGL with the names of the libraries found."""
    from ctypes.util import find_library

    return {name: find_library(name) for name in ("EGL", "OSMesa", "GL")}


def _kernels() -> Iterator[tuple[Path, Path]]:
    """Yield the index file and the cache folder of every kernel."""
    from numba.core.registry import CPUDispatcher

    from surehold.extras import missing

    seen: set[int] = set()
    for package in ("surehold.optimization", *([] if missing("grasp") else ["surehold.grasping"])):
        for info in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            module = importlib.import_module(info.name)
            for value in vars(module).values():
                if isinstance(value, CPUDispatcher) and id(value) not in seen:
                    seen.add(id(value))
                    cache: Any = getattr(value, "_cache", None)
                    file = getattr(cache, "_cache_file", None)
                    if file is not None:  # a kernel with cache=True
                        yield Path(file._index_path), Path(cache.cache_path)
