"""What the thesis shows and claims, where it leaves something open, and which plan redraws which table and figure."""

from typing import Final, Literal, NamedTuple

__all__ = ["CLAIMS", "EXHIBITS", "OPEN_PLACES", "Claim", "Exhibit", "OpenPlace", "exhibit_of"]


class Exhibit(NamedTuple):
    """A table of the thesis with its figures."""

    table: str
    measures: tuple[str, ...]
    """fields of a row that the table compares"""
    figures: dict[str, tuple[tuple[str, str], ...]]
    """figure -> (problem, measure) of its panels"""
    band: float
    """half-width of the figures' shaded band in standard errors"""


#: Exhibits by plan; a plan NAME-defaults shows the same.
EXHIBITS: Final[dict[str, Exhibit]] = {
    "table-4.1": Exhibit("4.1", ("best",), {"4.5": (("RKHS", "best"), ("GF", "best"), ("GM", "best"))}, 1.66),
    "table-4.2": Exhibit(
        "4.2",
        ("best",),
        {
            "4.6": (
                ("bottle side", "best"),
                ("bottle top", "best"),
                ("mug side", "best"),
                ("glass side", "best"),
                ("drill side", "best"),
            )
        },
        1.70,
    ),
    "table-4.3": Exhibit("4.3", ("best",), {"4.8": (("noise 0", "best"), ("noise 0.2", "best"))}, 1.66),
    "table-4.4": Exhibit(
        "4.4",
        ("mean", "worst", "std"),
        {"4.10": (("RKHS", "mean"), ("RKHS", "std")), "4.11": (("GM", "mean"), ("GM", "std"))},
        1.98,
    ),
    "table-4.4-grasps": Exhibit(
        "4.4",
        ("mean", "worst", "std"),
        {
            "4.12": (("bottle", "mean"), ("bottle", "std")),
            "4.13": (("mug", "mean"), ("mug", "std")),
            "4.14": (("glass", "mean"), ("glass", "std")),
            "4.15": (("drill", "mean"), ("drill", "std")),
            "4.17": (("glass 7-D", "mean"), ("glass 7-D", "std")),
        },
        2.05,
    ),
}


def exhibit_of(plan: str) -> Exhibit | None:
    """Return the exhibit of a plan, or None for a plan past the thesis."""
    return EXHIBITS.get(plan.removesuffix("-defaults"))


class Claim(NamedTuple):
    """A claim of the thesis about two methods, tested on common seeds."""

    text: str
    plan: str
    problem: str
    better: str
    than: str
    measure: str
    expected: Literal["better", "no better"]


def _claims() -> tuple[Claim, ...]:
    claims = []
    for problem in ("RKHS", "GM"):
        for k in ("1", "2", "3", "inf"):
            text = f"BO-TGP (w{k}) finds higher values than BO-GP on {problem}"
            claims.append(Claim(text, "table-4.1", problem, f"TGP-w{k}", "GP", "best", "better"))
    for k in ("1", "2", "3", "inf"):
        text = f"BO-TGP (w{k}) shows no significant gain on GF"
        claims.append(Claim(text, "table-4.1", "GF", f"TGP-w{k}", "GP", "best", "no better"))
    for problem in ("bottle side", "bottle top", "mug side", "glass side"):  # "generally", and "aside from the drill"
        text = f"BO-TGP (winf) finds higher values than BO-GP on {problem}"
        claims.append(Claim(text, "table-4.2", problem, "TGP-winf", "GP", "best", "better"))
    text = "BO-TGP (winf) finds no higher values than BO-GP on drill side"
    claims.append(Claim(text, "table-4.2", "drill side", "TGP-winf", "GP", "best", "no better"))
    for k in ("1", "2", "3", "inf"):
        expected = "better" if k == "3" else "no better"
        word = "better" if k == "3" else "no better"
        text = f"With observation noise BO-TGP (w{k}) is {word} than BO-GP on RKHS"
        claims.append(Claim(text, "table-4.3", "noise 0.2", f"TGP-w{k}", "GP", "best", expected))
    words = {"mean": "a higher mean", "worst": "a better worst case", "std": "a lower standard deviation"}
    for plan, problems in (
        ("table-4.4", ("RKHS", "GM")),
        ("table-4.4-grasps", ("bottle", "mug", "glass", "drill", "glass 7-D")),
    ):
        for problem in problems:
            for measure, word in words.items():
                other = (problem, measure) == ("mug", "mean")
                text = f"UBO has {'no higher mean' if other else word} than BO on {problem}"
                claims.append(Claim(text, plan, problem, "UBO", "BO", measure, "no better" if other else "better"))
    return tuple(claims)


CLAIMS: Final = _claims()


class OpenPlace(NamedTuple):
    """Something that the thesis leaves open, or where its text and its program differ."""

    what: str
    thesis: str
    chosen: str


OPEN_PLACES: Final = (
    OpenPlace(
        "The printed ±",
        "Called a standard deviation over all runs.",
        "Read as the half-width of a 90 % confidence interval of the mean (1.66 standard errors): the scatter of "
        "reruns is six times the printed value.",
    ),
    OpenPlace(
        "Shaded bands of the learning curves",
        "Called the standard deviation of the best observation (Figures 4.5, 4.6, 4.8) and a 95 % confidence interval "
        "(Figures 4.10 to 4.17).",
        "The first drawn as what the tables' ± are, the second as said.",
    ),
    OpenPlace(
        "Signal parameter",
        "σp is a standard deviation in the footnote's formula, a factor in (3.2).",
        "Used as the signal variance, as the original program does; 3.93 for RKHS, 0.40 for GF (text: 0.2; 0.40 meets "
        "Table 4.1), 0.0642 for GM in Table 4.1 and 0.642 in Table 4.4, the values that meet the tables.",
    ),
    OpenPlace(
        "Kernel in several dimensions",
        "(3.2) is written as a product over dimensions.",
        "One Matérn-5/2 of the scaled distance, as the program; the same in one dimension.",
    ),
    OpenPlace(
        "Noise of the model",
        "σn = 1e-6 as a noise level.",
        "A share of the signal variance added to the diagonal, as in the program.",
    ),
    OpenPlace(
        "Bias of the expected improvement",
        "ξ = 0.01, scaled by the signal's size.",
        "Divided by the signal parameter, as in the program: 0.0025 for RKHS, 0.025 for GF, 0.156 for GM in Table 4.1, "
        "none elsewhere. On GM that is more than the function's whole range (plan `table-4.1-printed`).",
    ),
    OpenPlace(
        "Free parameter of the unscented transformation",
        "k is not given.",
        "k = 1, which meets Table 4.4; k = 0 does not.",
    ),
    OpenPlace(
        "Which incumbent inside the unscented criterion",
        "Not said; the answer is the one with the best unscented outcome (3.22).",
        "The highest observed value, as in the program. The defaults improve upon the best unscented outcome instead.",
    ),
    OpenPlace(
        "Perturbed queries at the border",
        "Not said.",
        "A coordinate that would leave the box keeps its undisturbed value.",
    ),
    OpenPlace(
        "Answers during the initial design",
        "The curves begin with it, the selection rule is not said.",
        "The highest observed value, of every method.",
    ),
    OpenPlace(
        "Observation noise of Table 4.3",
        "y = f(x) - |e|, e ~ N(0, 0.2): deviation or variance, and whether the table shows y or f.",
        "0.2 as the standard deviation; shown is the highest y told.",
    ),
    OpenPlace(
        "Smallest leaf of the grasps",
        "Not given for the grasps.",
        "20 trials, as in the program.",
    ),
    OpenPlace(
        "Input noise of the water bottle",
        "Figure 4.12 says 0.01, text and Table 4.4 say 0.03.",
        "0.03.",
    ),
    OpenPlace(
        "First split marked in the figures",
        "Of which run and which weighting is not said.",
        "The median over all runs of the treed methods; weightings share it until their trials differ.",
    ),
    OpenPlace(
        "Grasp quality and objects",
        "Simox' normalized measure on Simox' own meshes; mug and drill are not public.",
        "The same measure, its slips included, on objects of the same kind and size; one contact a link, fingers that "
        "follow the synergy until they touch. Levels compare roughly, methods with each other fully.",
    ),
    OpenPlace(
        "Facets and thumb of the grasps",
        '"One of the sideways facets", the one with the handle for the mug, and the top of the bottle.',
        "right-front for bottle and glass, top-right for the bottle's top, back-right for the mug (its handle is "
        "there), front-right for the drill.",
    ),
    OpenPlace(
        "A point proposed again and again",
        "Not mentioned; the program jumps to a random point after twenty repetitions.",
        "A random point after the third trial at one place.",
    ),
    OpenPlace(
        "Local search of the criterion",
        "DIRECT, its budget and the local polish are not described.",
        "500 evaluations a dimension, a tenth of them for a polish along the gradient, then five starts by the "
        "incumbent. As in the program, DIRECT ends with the round that gains less than 1e-12. On GM the biased "
        "improvement is of that size, and the search ends near the centers of the leaves.",
    ),
)
