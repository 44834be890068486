"""The README's picture and the numbers beside it, made by the program itself: `make pictures`.

`docs/mug.json` holds what the picture shows; a test runs the same seed again and compares.
"""

import json
import subprocess
import sys
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, Final

DOCS: Final = Path(__file__).parent
COMMAND: Final = ("grasp", "mug", "--seed", "0")


def shown(folder: Path) -> dict[str, Any]:
    """Return what the picture of a run shows: each candidate's value, and its mean and lowest re-query."""
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    kept = ("x", "quality", "mean", "worst")
    return {
        "command": " ".join(("surehold", *COMMAND)),
        "surehold": result["surehold"],
        "candidates": {one["label"]: {name: one[name] for name in kept} for one in result["candidates"]},
    }


def run(folder: Path) -> dict[str, Any]:
    """Make the run into a folder and return what its picture shows."""
    subprocess.run([sys.executable, "-m", "surehold", *COMMAND, "--out", str(folder)], check=True)
    return shown(folder)


def main() -> None:
    """Write mug.png and mug.json."""
    with TemporaryDirectory() as folder:
        numbers = run(Path(folder))
        copyfile(Path(folder, "figures", "overview.png"), DOCS / "mug.png")
        (DOCS / "mug.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
