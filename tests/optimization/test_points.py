import datetime
import decimal

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.points import points_of
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

NAMES = ("dx", "dy")
BOX = Box({"dx": (0.0, 1.0), "dy": (0.0, 2.0)})
pandas = pytest.importorskip("pandas")


@pytest.mark.parametrize(
    "x",
    [
        [0.5, 0.9],
        (0.5, decimal.Decimal("0.9")),
        ["0.5", "0.9"],
        {"dx": 0.5, "dy": 0.9},
        {"dy": 0.9, "dx": 0.5},
        pandas.Series({"dy": 0.9, "dx": 0.5}),
        pandas.DataFrame({"dy": [0.9], "dx": [0.5]}).iloc[0],
        np.array((0.9, 0.5), dtype=[("dy", float), ("dx", float)]),
        np.ma.array([0.5, 0.9], mask=[False, False]),
    ],
    ids=lambda x: type(x).__name__,
)
def test_a_point_of_any_kind_is_read_by_its_names(x):
    np.testing.assert_array_equal(points_of(x, NAMES), [0.5, 0.9])
    optimizer = Optimizer(BOX)
    optimizer.tell(x, 1.0, reached=x)
    np.testing.assert_allclose(optimizer.X, [[0.5, 0.9]])
    np.testing.assert_allclose(BOX.to_unit(x), [0.5, 0.45])


def test_a_table_is_read_by_its_columns():
    table = pandas.DataFrame({"dy": [0.1, 0.2, 0.3], "dx": [0.4, 0.5, 0.6]})
    np.testing.assert_array_equal(points_of(table, NAMES), [[0.4, 0.1], [0.5, 0.2], [0.6, 0.3]])
    optimizer = Optimizer(BOX)
    optimizer.restore(table, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(optimizer.X, table[["dx", "dy"]])
    assert optimizer.predict(table)[0].shape == (3,)


@pytest.mark.parametrize("box", [BOX, Box({"dx": (0.0, 1.0), "dy": (0, 2, "int")})], ids=repr)
@pytest.mark.parametrize("kind", [dict, pandas.Series])
def test_a_list_of_named_points_is_read_by_their_names(box, kind):
    rows = [kind({"dy": 1.0, "dx": 0.4}), kind({"dx": 0.5, "dy": 2.0})]
    np.testing.assert_array_equal(box.points(rows), [[0.4, 1.0], [0.5, 2.0]])
    with pytest.raises(InputError, match="dx, dy"):
        box.points([rows[0], [0.5, 2.0]])


WRONG = {
    "masked": np.ma.array([1.0, 2.0], mask=[True, False]),
    "a date": np.array(["2020-01-01", "2020-01-02"], dtype="datetime64[D]"),
    "complex": [1.0, 2j],
    "not numeric": ["good", 1.0],
}


@pytest.mark.parametrize("words", WRONG)
def test_columns_of_stored_trials_are_numbers(words):
    rows, told = [[0.1, 0.2], [0.3, 0.4]], Optimizer(BOX, noise="told", constraints={"torque": (None, 1.0)})
    outputs = np.reshape(WRONG[words], (2, 1))
    for name, settings in {"y": {}, "noise": {"noise": WRONG[words]}, "outputs": {"outputs": outputs}}.items():
        with pytest.raises(InputError, match=f"^{name} .*{words}"):
            told.restore(rows, WRONG[words] if name == "y" else [1.0, 2.0], **settings)
    for data in ((rows, WRONG[words]), (np.column_stack([WRONG[words], WRONG[words]]), [1.0, 2.0])):
        if not (data[0] is not rows and words == "masked"):  # stacked columns lose their mask
            with pytest.raises(InputError, match="numeric"):
                GaussianProcess().fit(*data)


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (pandas.Series([0.5, 0.9]), "nothing about dx, dy"),
        ({"dx": 0.5}, "nothing about dy"),
        ({"dx": 0.5, "dy": 0.9, "dz": 0.1}, "'dz', which the box does not know"),
        ({"dx": 0.5, "dy": "much"}, "not numeric"),
        ({"dx": 0.5, "dy": [0.1, 0.2]}, "not numeric"),
        (np.ma.array([0.5, 0.9], mask=[True, False]), "masked"),
        ([np.ma.masked, 0.9], "masked"),
        (np.array([0.5 + 1j, 0.9]), "complex"),
        (np.array(["2020-01-01", "2020-01-02"], dtype="datetime64[D]"), "a date"),
        (np.array([1, 2], dtype="timedelta64[s]"), "a duration"),
        ([datetime.date(2020, 1, 1), 0.9], "not numeric"),
        ([np.datetime64("2020-01-01"), 0.9], "date|numeric"),
        ([pandas.Timestamp("2020-01-01"), 0.9], "date|numeric"),
        ([[0.5, 0.9], [0.1]], "not numeric"),
        ([10**400, 0.9], "not numeric"),
        (0.5, "shape"),
    ],
)
def test_what_is_no_point_is_refused_in_one_line(x, words):
    with pytest.raises(InputError, match=words) as caught:
        points_of(x, NAMES)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "y",
    [np.ma.masked, np.ma.array([2.0], mask=[True]), np.datetime64("2020-01-01"), np.complex128(2.0), 1 + 0j, 10**400],
    ids=repr,
)
def test_a_value_that_is_no_number_is_refused(y):
    optimizer = Optimizer(BOX)
    with pytest.raises(InputError, match="one finite number") as caught:
        optimizer.tell([0.5, 0.9], y)
    assert "\n" not in str(caught.value)
    assert len(optimizer.y) == 0
