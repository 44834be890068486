"""The README's picture with the numbers beside it, and the paper's figure, made by the program: `make pictures`.

`docs/mug.json` holds what the picture shows; a test runs the same seed again and compares. The paper's figure comes
from the runs in `results/peers`.
"""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, Final

DOCS: Final = Path(__file__).parent
COMMAND: Final = ("grasp", "mug", "--seed", "0")
PAPER: Final = DOCS.parent / "packaging" / "paper"


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


def peers(results: Path, path: Path) -> None:
    """Draw the mean under the input noise by trial, of all methods on the mixture of Gaussians, from stored runs."""
    from surehold.campaigns.report import read_campaigns
    from surehold.campaigns.sections import campaign_section
    from surehold.reports.campaign_figures import draw_picture

    picture = campaign_section(read_campaigns([results])["peers"]).pictures[0]
    panel = next(one for one in picture.panels if one.title == "GM" and one.ylabel.startswith("mean"))
    draw_picture(replace(picture, panels=(panel,))).savefig(path, dpi=200)


def main() -> None:
    """Write mug.png, mug.json and the paper's peers.png."""
    peers(DOCS.parent / "results" / "peers", PAPER / "peers.png")
    with TemporaryDirectory() as folder:
        numbers = run(Path(folder))
        copyfile(Path(folder, "figures", "overview.png"), DOCS / "mug.png")
        (DOCS / "mug.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
