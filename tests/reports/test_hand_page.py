"""The page of a hand: the open hand beside the closing one, axes, joints, and what looks wrong."""

import base64
import json
import re

import numpy as np
import pytest

from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.model import CLOSED
from surehold.grasping.hand.named import hand_named
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.pictures.hand import hand_scene
from surehold.reports.hand_page import joint_rows, render_hand


@pytest.fixture(scope="module")
def page():
    return render_hand(hand_named("icub-left"), [("force", "8 N <b>")], ["palm.z <turned> over"])


@pytest.fixture(scope="module")
def scene(page):
    return json.loads(re.search(r'id="scene-data">(.*?)</script>', page, re.DOTALL)[1])


def test_what_is_wrong_and_facts_are_on_the_page_as_text(page):
    assert '<p class="note">palm.z &lt;turned&gt; over</p>' in page
    assert "8 N &lt;b&gt;" in page
    assert "friction cones" not in page
    assert "Drag to turn" in page


def test_each_preshape_is_a_view_with_two_hands_and_axes(scene):
    assert [view["label"] for view in scene["views"]] == ["power", "tripod", "pinch"]
    names = [scene["meshes"][i]["name"] for i in scene["views"][0]["meshes"]]
    for name, count in (("palm", 2), ("index distal", 2), ("x", 2), ("z", 2), ("thumb_middle", 2), ("grasp center", 2)):
        assert names.count(name) == count, name
    steps = [
        np.frombuffer(base64.b64decode(scene["buffers"][key]), "<f4").size // 12 for key in scene["views"][0]["poses"]
    ]
    half = len(names) // 2
    assert set(steps[:half]) == {1}, "the open hand rests"
    assert max(steps[half:]) > 10, "the other one closes"


def test_the_two_hands_do_not_overlap(scene):
    def across(key):
        return np.frombuffer(base64.b64decode(scene["buffers"][key]), "<f4").reshape(-1, 3, 4)[:, 0, 3]

    places = [across(key) for key in scene["views"][0]["poses"]]
    half = len(places) // 2
    assert max(place.max() for place in places[:half]) < min(place.min() for place in places[half:])


def test_links_and_joint_axes_are_where_kinematics_has_them():
    hand = hand_named("icub-left")
    drawn = hand_scene(hand, "power")
    q = closing_motion(hand, 0.0, "power").joints(CLOSED)
    ends = link_ends(hand.bases, hand.chains, q)
    body = next(mesh for mesh in drawn.bodies if mesh.name == "middle distal")
    corners = body.vertices @ body.poses[-1, :, :3].T + body.poses[-1, :, 3]
    expected = ends[hand.link_names.index("middle distal")].mean(axis=0)
    np.testing.assert_allclose(0.5 * (corners.min(axis=0) + corners.max(axis=0)), expected, atol=2e-4)
    rod = next(mesh for mesh in drawn.joints if mesh.name == "middle_distal")
    place = rod.poses[-1, :, 3]
    np.testing.assert_allclose(place, ends[hand.link_names.index("middle distal")][0], atol=1e-6)
    arrow = next(mesh for mesh in drawn.axes if mesh.name == "y")
    tip = arrow.vertices[np.linalg.norm(arrow.vertices, axis=1).argmax()]
    np.testing.assert_allclose(tip / np.linalg.norm(tip), [0.0, 1.0, 0.0], atol=1e-6)
    edges = np.sort(np.concatenate([arrow.faces[:, [0, 1]], arrow.faces[:, [1, 2]], arrow.faces[:, [2, 0]]]), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2), "the arrow is closed"


def test_joints_their_ranges_and_both_ends():
    hand = hand_named("icub-left")
    rows = {row[1]: row for row in joint_rows(hand, "pinch")}
    assert len(rows) == 20
    assert rows["index_proximal"] == ("index", "index_proximal", "0.00 to 1.57 rad", "0.00", "1.30")
    assert rows["ring_middle"][4] == "rests"
