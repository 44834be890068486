"""What is wrong with a description is named: keys, values and their lines."""

import pytest

from surehold.errors import InputError
from surehold.grasping.hand.configuration import read_hand_config

TEXT = """\
name: claw
model: {file: claw.xml}
palm:
  body: base
  x: [1, 0, 0]
  z: [0, 0, 1]
  grasp_center: [0, 0, 0.1]
fingers:
  left: [a1, b1]
preshapes:
  close:
    open: {a1: 0.1}
    closed: {a1: 1.2}
"""


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("palm:", "plam:", ["line 3: 'plam' is no key here (did you mean 'palm'?)", "'palm' is missing"]),
        ("  body: base\n", "", ["line 3: 'palm.body' is missing"]),
        ("    open:", "    opne:", ["line 12: 'preshapes.close.opne' is no key here (did you mean 'open'?)"]),
        ("name: claw", "color: 2\nname: claw", ["line 1: 'color' is no key here (choose one of name, palm, fingers"]),
        ("name: claw", "name: claw\nfinger_force: -3", ["line 2: 'finger_force' is -3, and must be: greater than 0"]),
        ("{a1: 1.2}", "{a1: wide}", ["line 13: 'preshapes.close.closed.a1' is 'wide', and must be: a valid number"]),
        ("[a1, b1]", "[a1, 3]", ["line 9: 'fingers.left.1' is 3, and must be: a valid string"]),
        ("{file: claw.xml}", "claw.xml", ["line 2: 'model' is 'claw.xml', and must be: a mapping such as {file: "]),
        ("{file: claw.xml}", "{fil: claw.xml}", ["line 2: 'model.fil' is no key here (did you mean 'file'?)"]),
        ("{file: claw.xml}", "{package: a, path: b}", ["line 2: 'model.distribution' is missing"]),
        (
            "name: claw",
            "name: claw\nsources: {fingerforce: x}",
            ["line 2: 'sources.fingerforce' is no key"],
        ),
        ("name: claw", "name: claw\ncoupling: 3", ["line 2: 'coupling' is 3, and must be: a mapping. All keys"]),
        ("name: claw", "coupling: {b1: {folows: a1}}", ["'name' is missing", "line 1: 'coupling.b1.folows' is no key"]),
        ("closed: {a1: 1.2}", "posture: 3", ["line 13: 'preshapes.close.posture' is 3, and must be: a mapping with"]),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, right, wrong, said):
    assert TEXT.count(right) == 1
    (tmp_path / "hand.yaml").write_text(TEXT.replace(right, wrong))
    with pytest.raises(InputError) as error:
        read_hand_config(tmp_path / "hand.yaml")
    for words in said:
        assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_right_is_read_and_many_mistakes_are_counted(tmp_path):
    (tmp_path / "hand.yaml").write_text(TEXT)
    assert read_hand_config(tmp_path / "hand.yaml").name == "claw"
    (tmp_path / "hand.yaml").write_text(TEXT + "".join(f"extra_{k}: {k}\n" for k in range(9)))
    with pytest.raises(InputError, match=r"line 14: 'extra_0' .* line 19: 'extra_5' .*; and 3 more\. All keys"):
        read_hand_config(tmp_path / "hand.yaml")
