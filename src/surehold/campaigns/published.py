"""The thesis' published numbers, and what its original program cost.

Every published "mean ± pm" is called a standard deviation over runs in the captions, but reruns of the original program
scatter 6 times as much over 100 runs. The printed value is what 1.66 standard errors are, the half-width of a 90 %
confidence interval of the mean (1.70 for 30 runs); it is read as such here.
"""

import csv
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

__all__ = ["ORIGINAL_SECONDS", "Published", "published", "published_tables"]


class Published(NamedTuple):
    """A published number."""

    mean: float
    pm: float | None
    """the printed ±; None where there is none"""
    runs: int
    unit: float
    """of the last printed digit"""

    @property
    def std(self) -> float | None:
        """Standard deviation over runs that the printed ± stands for; None where there is none."""
        if self.pm is None:
            return None
        from scipy.stats import t

        return self.pm / float(t.ppf(0.95, self.runs - 1)) * self.runs**0.5


#: CPU seconds of one run of the original program by problem and method, on a machine whose LAPACK dpotrf takes 1e-4 s
#: for 140 x 140.
ORIGINAL_SECONDS: Final[dict[tuple[str, str], float]] = {
    ("RKHS", "GP"): 2.16,
    ("RKHS", "TGP-w1"): 3.42,
    ("RKHS", "TGP-winf"): 1.35,
    ("RKHS", "BO"): 2.16,
    ("RKHS", "UBO"): 2.06,
    ("GF", "GP"): 5.65,
    ("GF", "TGP-w1"): 9.15,
    ("GF", "TGP-winf"): 5.09,
    ("GM", "GP"): 101.0,
    ("GM", "TGP-w1"): 230.0,
    ("GM", "TGP-winf"): 20.5,
    ("GM", "BO"): 59.5,
    ("GM", "UBO"): 69.4,
}

_RUNS: Final = {"4.1": 100, "4.2": 30, "4.3": 100, "4.4": 100}


def published_tables() -> list[str]:
    """Return the names of the published tables."""
    return sorted(_RUNS)


def published(table: str, problem: str, method: str, measure: str) -> Published | None:
    """Return the number of a table for labels and measure as the shipped plans name them, or None."""
    return _numbers(table).get((problem, method, measure))


@cache
def _numbers(table: str) -> dict[tuple[str, str, str], Published]:
    text = (files("surehold.campaigns") / "published" / f"table-{table}.csv").read_text(encoding="utf-8")
    found: dict[tuple[str, str, str], Published] = {}
    for row in csv.DictReader(line for line in text.splitlines() if not line.startswith("#")):
        if table == "4.4":
            runs = 100 if row["problem"] in ("RKHS", "GM") else 30
            for name, measure in (("ymc", "mean"), ("worst", "worst"), ("std", "std")):
                for method in ("BO", "UBO"):
                    printed = row[f"{name}_{method}"]
                    found[row["problem"], method, measure] = Published(float(printed), None, runs, _unit(printed))
            continue
        problem = {"4.1": "{function}", "4.2": "{object} {facet}", "4.3": "noise {noise}"}[table].format(**row)
        found[problem, row["method"], "best"] = Published(
            float(row["mean"]), float(row["pm"]), _RUNS[table], _unit(row["mean"])
        )
    return found


def _unit(printed: str) -> float:
    return 10.0 ** -len(printed.partition(".")[2])
