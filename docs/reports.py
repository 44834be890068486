"""Reports to look at, one of each kind of run, made by the command line while the site is built."""

import subprocess
import sys
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

ROOT: Final = Path(__file__).parents[1]

#: name -> title, command, its page, its picture if there is one
RUNS: Final = {
    "grasp": (
        "A grasp, and why the highest was refused",
        "surehold grasp mug --trials 40 --initial 30",
        "report.html",
        "grasp.png",
    ),
    "function": (
        "A function of one variable",
        "surehold maximize rkhs --trials 30 --noise 0.03",
        "report.html",
        "figures/overview.png",
    ),
    "success": (
        "Trials that only succeed or fail",
        "surehold maximize reports.py:held --bounds a=0:1,b=0:1 --noise 0.05 --outcome success --trials 40",
        "report.html",
        "figures/overview.png",
    ),
    "campaign": (
        "Many runs: two methods, eight problems",
        "surehold campaign report noise-levels",
        "campaigns.html",
        "figures/noise-levels-curves.png",
    ),
    "hand": ("A hand, to look at before it grasps", "surehold hand show icub-left", "hand.html", None),
}

CARD: Final = """:::{{grid-item-card}} {title}
:link: ../reports/{name}.html
{picture}
`{command}`
:::
"""


def held(x: np.ndarray) -> bool:
    """Return whether a trial at x, (2,), succeeds: by chance, most often at (0.6, 0.4)."""
    chance = np.exp(-0.5 * (((x[0] - 0.6) / 0.2) ** 2 + ((x[1] - 0.4) / 0.3) ** 2))
    return bool(np.random.default_rng(x.view(np.uint64)).random() < chance)


def write(folder: Path) -> None:
    """Make the runs that are not there, their pages into `reports`, pictures into `pictures`, cards into cards.md."""
    pages, pictures = folder / "pages" / "reports", folder / "pictures"
    pages.mkdir(parents=True, exist_ok=True)
    pictures.mkdir(exist_ok=True)
    cards = []
    for name, (title, command, page, picture) in RUNS.items():
        if not (pages / f"{name}.html").exists():
            _run(command, page, pages / f"{name}.html", picture, pictures / f"{name}.png")
        shown = f":img-top: /generated/pictures/{name}.png\n" if picture else ""
        cards.append(CARD.format(name=name, title=title, command=command, picture=shown))
    (folder / "cards.md").write_text("::::{grid} 1 2 2 2\n:gutter: 3\n\n" + "\n".join(cards) + "::::\n", "utf-8")


def _run(command: str, page: str, to: Path, picture: str | None, picture_to: Path) -> None:
    with TemporaryDirectory() as folder:
        copyfile(__file__, Path(folder, "reports.py"))
        Path(folder, "noise-levels").symlink_to(ROOT / "results" / "noise-levels")
        arguments = [sys.executable, "-m", *command.split(), "--out", "made"]
        made = subprocess.run(arguments, cwd=folder, capture_output=True, text=True)
        if made.returncode:
            raise RuntimeError(f"`{command}` ended with {made.returncode}: {made.stderr}")
        copyfile(Path(folder, "made", page), to)
        if picture:
            copyfile(Path(folder, "made", picture), picture_to)
