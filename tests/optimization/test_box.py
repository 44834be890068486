import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surehold.errors import InputError
from surehold.optimization.box import Box

finite = st.floats(-1e6, 1e6)
bounds = st.tuples(finite, st.floats(1e-3, 1e6)).map(lambda p: (p[0], p[0] + p[1]))


@given(st.lists(bounds, min_size=1, max_size=5), st.data())
def test_unit_and_back(pairs, data):
    box = Box({f"v{i}": pair for i, pair in enumerate(pairs)})
    u = np.array(data.draw(st.lists(st.floats(0.0, 1.0), min_size=len(pairs), max_size=len(pairs))))
    x = box.from_unit(u)
    assert np.all((x >= box.lower) & (x <= box.upper)), "a point of the cube left the box"
    np.testing.assert_allclose(box.to_unit(x), u, atol=1e-9 + 1e-15 * np.abs(box.lower).max() / box.widths.min())


def test_batches_keep_their_shape():
    box = Box({"a": (-1.0, 3.0), "b": (0.0, 10.0)})
    assert box.to_unit(np.zeros((4, 3, 2))).shape == (4, 3, 2)
    np.testing.assert_allclose(box.from_unit([[0.5, 0.5], [1.0, 0.0]]), [[1.0, 5.0], [3.0, 0.0]])


def test_order_of_names_is_order_of_coordinates():
    box = Box({"z": (0, 1), "a": (0, 2)})
    assert box.names == ("z", "a")
    assert box.dimension == 2
    assert box.as_dict([0.25, 1.5]) == {"z": 0.25, "a": 1.5}


def test_contains_forgives_rounding_only():
    box = Box({"x": (0.0, 0.3)})
    assert box.contains([0.1 + 0.2])
    assert not box.contains([0.31])
    assert not box.contains([np.nan])


def test_equal_boxes():
    assert Box({"x": (0, 1)}) == Box({"x": (0.0, 1.0)})
    assert hash(Box({"x": (0, 1)})) == hash(Box({"x": (0.0, 1.0)}))
    assert Box({"x": (0, 1)}) != Box({"y": (0, 1)})
    assert Box({"x": (0, 1)}) != "box"


def test_bounds_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Box({"x": (0, 1)}).lower[0] = 5.0


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({}, "one or more"),
        ([(0, 1)], "mapping"),
        ({"x": (1.0, 0.0)}, "lower must be smaller"),
        ({"x": (1.0, 1.0)}, "lower must be smaller"),
        ({"x": (-1e308, 1e308)}, "too far apart"),
        ({"x": (0.0, np.inf)}, "finite"),
        ({"x": (np.nan, 1.0)}, "finite"),
        ({"x": (0.0, 1.0, 2.0)}, "two numbers"),
        ({"x": 3.0}, "two numbers"),
        ({"": (0.0, 1.0)}, "name"),
        ({3: (0.0, 1.0)}, "name"),
    ],
)
def test_bad_bounds(bad, words):
    with pytest.raises(InputError, match=words):
        Box(bad)


@pytest.mark.parametrize("bad", [[1.0], [1.0, 2.0, 3.0], 1.0, "ab", [[1.0], [2.0]], None])
def test_bad_points(bad):
    with pytest.raises(InputError):
        Box({"x": (0, 1), "y": (0, 1)}).to_unit(bad)
