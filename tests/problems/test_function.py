import sys

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.problems import Function, Problem, load_function, parse_bounds


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "my_neighbor_constants.py").write_text("SHIFT = 0.25\n")
    (tmp_path / "my_own_function.py").write_text(
        "from my_neighbor_constants import SHIFT\n"
        "def hill(x):\n    return -float(((x - SHIFT) ** 2).sum())\n"
        "class Robot:\n    @staticmethod\n    def score(x):\n        return x[0]\n"
        "number = 3\n"
    )
    (tmp_path / "broken.py").write_text("1 / 0\n")
    (tmp_path / "program.py").write_text("import sys\ndef f(x):\n    return 1.0\nsys.exit(0)\n")
    (tmp_path / "lacks.py").write_text("import no_such_module_at_all\n")
    (tmp_path / "empty.py").write_text("number = 3\n")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for name in ("my_neighbor_constants", "my_own_function", "broken", "lacks", "empty"):
        sys.modules.pop(name, None)


def test_from_a_file_and_from_a_module(folder):
    x = np.array([0.5, 0.25])
    before = list(sys.path)
    for reference in ("my_own_function.py:hill", f"{folder}/my_own_function.py:hill", "my_own_function:hill"):
        assert load_function(reference)(x) == -0.0625
    assert load_function("my_own_function:Robot.score")(x) == 0.5
    assert load_function("math:hypot")(3, 4) == 5
    assert sys.path == before


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("my_own_function", "form package.module:function"),
        (":hill", "form package.module:function"),
        ("missing.py:f", "does not exist"),
        ("no_such_package.module:f", "is not found"),
        ("my_own_function:hil", "did you mean 'hill'"),
        ("my_own_function.py:number", "is a int, not a function"),
        ("empty:f", "no function 'f'"),
        ("broken.py:f", "fails to load: ZeroDivisionError"),
        ("broken:f", "fails to load: ZeroDivisionError"),
        ("program.py:f", "fails to load: SystemExit: 0"),
        ("program:f", "fails to load: SystemExit: 0"),
        ("lacks:f", "fails to load: No module named 'no_such_module_at_all'"),
    ],
)
def test_bad_references(folder, reference, message):
    with pytest.raises(InputError, match=message):
        load_function(reference)


def test_function_is_a_problem():
    p = Function(lambda x: x.sum(), parse_bounds("a=0:1,b=-2:2"), name="sum")
    assert isinstance(p, Problem)
    assert p([0.5, 1.0]) == 1.5
    assert isinstance(p([0.5, 1.0]), float)
    np.testing.assert_array_equal(p([[0.5, 1.0], [0.0, -1.0]]), [1.5, -1.0])
    assert Function(lambda x: np.array([[2.0]]), Box.unit(1))([0.3]) == 2.0


def test_the_function_cannot_change_the_point():
    def greedy(x):
        x[:] = 0
        return 1.0

    point = np.array([0.5])
    Function(greedy, Box.unit(1))(point)
    assert point[0] == 0.5


def test_a_function_does_not_end_the_run():
    """The command ended without a word, with the exit code of the function, and the trials before were lost."""
    own = Function(lambda x: sys.exit(3), Box.unit(1), name="f")
    for call in (own, own.trial):
        with pytest.raises(RuntimeError, match=r"it called sys\.exit\(3\)"):
            call(np.array([0.5]))


@pytest.mark.parametrize("value", ["fast", None, [1.0, 2.0], 1 + 2j])
def test_bad_returns(value):
    with pytest.raises(InputError, match="must return one real number"):
        Function(lambda x: value, Box.unit(1), name="f")([0.5])


def test_not_callable():
    with pytest.raises(InputError, match="cannot be called"):
        Function(3, Box.unit(1))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "form name=lower:upper"),
        ("a=1", "form name=lower:upper"),
        ("a=0:one", "form name=lower:upper"),
        ("f=0.1:10:log", "study create --parameters"),
        ("grip=pinch|power", "study create --parameters"),
        ("a=0:1,a=0:2", "twice"),
        ("a=1:0", "smaller"),
        ("a=1:1", "smaller"),
        ("a=0:inf", "finite"),
        ("=0:1", "form name=lower:upper"),
        ("a=0:1;b=0:1", r"'a=0:1;b=0:1' are not of the form name=lower:upper; .*dy=0:1\.$"),
        ("a=0:1 b=0:1", "form name=lower:upper"),
    ],
)
def test_bad_bounds(text, message):
    with pytest.raises(InputError, match=message):
        parse_bounds(text)


def test_bounds():
    assert parse_bounds(" dx = -0.05:5e-2 , dy=0:1") == Box({"dx": (-0.05, 0.05), "dy": (0, 1)})
    assert parse_bounds("0:1,2:3") == Box({"x1": (0, 1), "x2": (2, 3)})
