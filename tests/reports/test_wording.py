import pytest

from surehold.optimization.limits import parsed_limit
from surehold.reports.wording import setting


@pytest.mark.parametrize("limits", [[None, 0.5], [1.0, 3.0], [0.0, None], [None, None]])
def test_limits_are_written_as_the_command_line_takes_them(limits):
    assert parsed_limit(setting({"force": limits})) == ("force", tuple(limits))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ([{"x": 0.1, "grip": "pinch"}, {"x": 0.2, "grip": "power"}], "x=0.1, grip=pinch; x=0.2, grip=power"),
        (["a + b <= 3"], "a + b <= 3"),
        ({"tilt": 0}, "tilt=0"),
        ({"name": "cvar", "of": ["a", 2.5, None]}, "name=cvar, of=a; 2.5; none"),
        (None, "none"),
        (True, "yes"),
        (0.95, "0.95"),
    ],
)
def test_settings_are_no_python(value, text):
    assert setting(value) == text
