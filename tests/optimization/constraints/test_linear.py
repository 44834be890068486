import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.constraints.linear import Linear


@pytest.mark.parametrize(
    ("text", "weights", "lower", "upper"),
    [
        ("a + 2*b <= 3", {"a": 1.0, "b": 2.0}, None, 3.0),
        ("a + 2b <= 3", {"a": 1.0, "b": 2.0}, None, 3.0),
        ("a - .5 b >= 1e-3", {"a": 1.0, "b": -0.5}, 1e-3, None),
        ("0 <= a - b <= 1", {"a": 1.0, "b": -1.0}, 0.0, 1.0),
        ("1 >= a + 2 >= 0", {"a": 1.0}, -2.0, -1.0),
        ("3 <= a + b", {"a": 1.0, "b": 1.0}, 3.0, None),
        ("a <= b", {"a": 1.0, "b": -1.0}, None, 0.0),
        ("-a + 3 < 2 - 2*b", {"a": -1.0, "b": 2.0}, None, -1.0),
        ("link.a-x_1<=0", {"link.a": 1.0, "x_1": -1.0}, None, 0.0),
        ("3 <= a + b + 1", {"a": 1.0, "b": 1.0}, 2.0, None),
        ("a + 2*b + a <= 1", {"a": 2.0, "b": 2.0}, None, 1.0),
        ("3*a + b <= a", {"a": 2.0, "b": 1.0}, None, 0.0),
        ("1 + a + 2 - .5 <= 5", {"a": 1.0}, None, 2.5),
    ],
)
def test_a_text_says_what_the_weights_say(text, weights, lower, upper):
    assert Linear.parse(text) == Linear(weights, lower=lower, upper=upper)


def test_its_own_text_is_read_again():
    for text in ("a + 2*b <= 3", "0 <= a - b <= 1", "0.5 <= 3*a"):
        rule = Linear.parse(text)
        assert Linear.parse(str(rule)) == rule


@pytest.mark.parametrize(
    "text", ["", "a", "a = 3", "a + <= 3", "a +* b < 2", "1 <= 2", "a <= b <= c", "1 <= a >= 0", "a b <= 3", "<= 3"]
)
def test_what_is_not_understood_is_refused_in_one_line(text):
    with pytest.raises(InputError) as error:
        Linear.parse(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("weights", "limits", "message"),
    [
        ({"a": 1.0}, {}, "no limit"),
        ({"a": 1.0}, {"lower": 2.0, "upper": 2.0}, "leaves nothing"),
        ({"a": 0.0}, {"upper": 2.0}, "weighs no variable"),
        ({"a": np.nan}, {"upper": 2.0}, "not finite"),
        ({"a": 1.0}, {"upper": np.inf}, "not finite"),
        ({"a": "x"}, {"upper": 1.0}, "no number"),
        ([1.0], {"upper": 1.0}, "give {name: weight}"),
    ],
)
def test_bad_constraints(weights, limits, message):
    with pytest.raises(InputError, match=message):
        Linear(weights, **limits)


def test_row_is_in_the_order_of_the_names():
    assert Linear({"b": 2.0}, upper=1.0).row(("a", "b", "c")).tolist() == [0.0, 2.0, 0.0]
    with pytest.raises(InputError, match="'z' is unknown"):
        Linear({"z": 2.0}, upper=1.0).row(("a", "b"))
