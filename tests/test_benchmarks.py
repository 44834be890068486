"""The stored table of benchmarks: what is written is read again, and a loss is marked. Nothing is timed here."""

import pytest

from benchmarks import stored
from benchmarks.regret_causes import cause
from benchmarks.stored import Row


def test_a_stored_table_is_compared_in_yardsticks(tmp_path):
    assert stored.last(tmp_path) == {}
    path = stored.store([Row("ask", 0.02, asked=0.1), Row("grasp", 0.001)], 1e-4, 1.5, tmp_path)
    assert path.parent == tmp_path
    before = stored.last(tmp_path)
    assert before == {"ask": 200.0, "grasp": 10.0}
    assert stored.read(tmp_path)["rows"]["ask"] == {"seconds": 0.02, "asked": 0.1}
    rows = [Row("ask", 0.03, asked=0.06, floor=0.001), Row("grasp", 0.0021, asked=0.002), Row("more", 1.0)]
    head, ask, grasp, new = stored.lines(rows, 2e-4, before)
    assert "to the last" in head
    assert ask.split()[-3:] == ["0.5", "30", "0.75"], "the machine is half as fast: it is a gain"
    assert grasp.endswith(" 1.05  OVER")
    assert new.endswith("new")
    (_, lost) = stored.lines([Row("ask", 0.03)], 1e-4, before)
    assert lost.endswith("1.50  SLOWER")


@pytest.mark.parametrize(
    ("full", "tried", "climb", "z", "expected"),
    [
        (0.9, 0.9, 0.0, 9.0, "found"),
        (1.5, 0.9, 0.0, 9.0, "answer"),
        (1.5, 1.2, 0.9, 9.0, "climb"),
        (1.5, 1.2, 1.1, 2.9, "search"),
        (1.5, 1.2, 1.1, 3.1, "model"),
    ],
)
def test_the_first_cause_that_is_true_is_that_of_a_regret(full, tried, climb, z, expected):
    assert cause({"full": full, "tried": tried, "climb": climb, "z": z}) == expected
