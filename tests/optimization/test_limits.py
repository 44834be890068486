import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.limits import checked_outputs, limits_of, parsed_limit

LIMITS = limits_of({"torque": (None, 3.0), "force": (1.0, 2.0), "temperature": (None, None)})


def test_limits_and_misses():
    torque, force, temperature = LIMITS
    assert torque.missed_by(np.array([2.5, 3.1])) == pytest.approx([-0.5, 0.1])
    assert force.missed_by(np.array([0.7, 1.5, 2.2])) == pytest.approx([0.3, -0.5, 0.2])
    assert temperature.watched
    assert not torque.watched


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("torque<=3", ("torque", (None, 3.0))),
        ("torque >= -1.5", ("torque", (-1.5, None))),
        ("1 <= torque", ("torque", (1.0, None))),
        ("3 > torque", ("torque", (None, 3.0))),
        ("1 <= torque <= 3", ("torque", (1.0, 3.0))),
        ("3 >= torque >= 1", ("torque", (1.0, 3.0))),
        ("temperature", ("temperature", (None, None))),
    ],
)
def test_a_limit_as_text(text, expected):
    assert parsed_limit(text) == expected


@pytest.mark.parametrize(
    "text", ["", "3", "a<=b", "1<=a>=0", "a<=", "1<=2", "a<=1<=b", "a=3", "a==3", "a=<3", "a=>3", "a≤3"]
)
def test_a_text_that_is_no_limit(text):
    with pytest.raises(InputError, match="not understood"):
        parsed_limit(text)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        ({"t": (3.0, 2.0)}, "lower one must be smaller"),
        ({"t": (2.0, 2.0)}, "lower one must be smaller"),
        ({"t": (None, np.nan)}, "lower one must be smaller"),
        ({"t": 3.0}, "give \\(lower, upper\\)"),
        ({"t": (True, 2.0)}, "give \\(lower, upper\\)"),
        ({"": (None, 1.0)}, "name each output"),
        ([("t", 1.0)], "None where there is no limit"),
    ],
)
def test_bad_limits(constraints, message):
    with pytest.raises(InputError, match=message):
        limits_of(constraints)


def test_what_a_trial_tells():
    assert checked_outputs(LIMITS, {"torque": 1, "force": 1.5}, False)[:2] == (1.0, 1.5)
    assert np.isnan(checked_outputs(LIMITS, {"torque": None, "force": 1.5}, False)[0])
    assert np.isnan(checked_outputs(LIMITS, None, True)).all()


@pytest.mark.parametrize(
    ("told", "message"),
    [
        (None, "says nothing about 'torque'"),
        ({"torque": 1.0}, "says nothing about 'force'"),
        ({"torqe": 1.0}, "did you mean 'torque'"),
        ({"torque": "x", "force": 1.0}, "'torque' is 'x'"),
        ({"torque": np.inf, "force": 1.0}, "'torque' is inf"),
        ({"torque": True, "force": 1.0}, "'torque' is True"),
        (3.0, "give {name: value}"),
    ],
)
def test_what_a_trial_may_not_tell(told, message):
    with pytest.raises(InputError, match=message):
        checked_outputs(LIMITS, told, False)


def test_outputs_for_an_optimizer_without_constraints():
    with pytest.raises(InputError, match="this optimizer has no constraints"):
        checked_outputs((), {"torque": 1.0}, False)
