"""The examples that put the optimizer into another library's own loop: it ends with what holds, not with the spike."""

import importlib.util
from pathlib import Path

import pytest

import surehold as sh

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.filterwarnings("ignore")  # of the other libraries and what they import
@pytest.mark.parametrize(
    ("library", "name", "loop"),
    [
        ("ax", "ax_generation_node", "run"),
        ("baybe", "baybe_recommender", "campaign"),
        ("pymoo", "pymoo_algorithm", "run"),
    ],
)
def test_the_loop_ends_with_what_holds(library, name, loop):
    pytest.importorskip(library)
    answer, observed = getattr(example(name), loop)(50)
    f, noise = sh.problems.GM(), sh.InputNoise.unit(0.1)
    best = sh.problems.robust_optimum(f, noise).x
    held, spike, most = (sh.problems.robust_score(f, x, noise, n=2000, seed=1).mean for x in (answer.x, observed, best))
    assert held > 0.9 * most
    assert held > 1.1 * spike, "the seed is one of those with which the loop observes the spike, too"
