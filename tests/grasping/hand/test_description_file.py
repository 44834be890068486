"""The written description says what was proposed, whatever the names are."""

import pytest

from surehold.grasping.hand.configuration import ModelFile, read_hand_config
from surehold.grasping.hand.description_file import description_text
from surehold.grasping.hand.proposal import propose_hand
from tests.grasping.hand_models import SLIDING, five_fingers, linkage


@pytest.mark.parametrize(
    ("model", "file"),
    [
        (five_fingers(), "my hand.xml"),
        (
            five_fingers().replace("index_spread", "1").replace("index_bend_1", "on").replace("ring_bend", "a: b #"),
            "1.xml",
        ),
        (five_fingers().replace("index_bend_1", "x&#10;palm: {}").replace("thumb_bend_2", "'&quot;\\, ["), "a.xml"),
        (SLIDING, "#.xml"),
        (linkage(), "null.xml"),
    ],
)
def test_what_is_written_is_read(tmp_path, model, file):
    (tmp_path / file).write_text(model)
    found = propose_hand(tmp_path / file)
    (tmp_path / "hand.yaml").write_text(description_text(found, file))
    written = read_hand_config(tmp_path / "hand.yaml")
    assert written.model == ModelFile(file=file)
    assert written.model_copy(update={"model": None}) == found.config


def test_comments_say_what_joints_do_and_how_far_they_go(tmp_path):
    (tmp_path / "hand.xml").write_text(five_fingers())
    text = description_text(propose_hand(tmp_path / "hand.xml"), "hand.xml")
    assert "      index_bend_2: 1.5708  # bends, 0 to 1.571\n" in text
    assert "# opposes, 0 to 1.92" in text
    assert "x: [1, 0, 0]  # along the fingers" in text
    (tmp_path / "bars.xml").write_text(linkage())
    text = description_text(propose_hand(tmp_path / "bars.xml"), "bars.xml")
    assert "# by the model: inner_l follows drive_l, pad_l follows drive_l, inner_r" in text
    assert "# joints that no finger has, and that stay at rest: drive_r\n" in text
