"""What is said of hands that are described wrongly, and that nothing is said of others."""

from dataclasses import replace

import numpy as np
import pytest

from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.inspection import finger_motions, hand_faults
from surehold.grasping.hand.named import hand_named
from surehold.grasping.hand.proposal import propose_hand
from tests.grasping.hand_models import SLIDING, five_fingers


@pytest.fixture(params=["hand", "gripper"])
def described(request, tmp_path):
    path = tmp_path / f"{request.param}.xml"
    path.write_text(five_fingers() if request.param == "hand" else SLIDING)
    return path, propose_hand(path).config.model_dump()


def changed(described, **changes):
    path, config = described
    preshape = next(iter(config["preshapes"].values()))
    for name, value in changes.items():
        (config["palm"] if name in config["palm"] else preshape)[name] = value
    return load_hand(path, HandConfig.model_validate(config))


@pytest.mark.parametrize("name", ["icub-left", "icub-right"])
def test_nothing_is_wrong_with_the_built_in_hands(name):
    hand = hand_named(name)
    assert hand_faults(hand) == []
    assert all(hand_faults(hand, preshape) == [] for preshape in hand.preshapes)


def test_a_palm_that_is_turned_over(described):
    (fault,) = hand_faults(changed(described, z=[0, 0, -1]))
    assert "close behind the palm" in fault
    assert "palm.z" in fault


def test_open_and_closed_exchanged(described):
    preshape = next(iter(described[1]["preshapes"].values()))
    moved = {joint: preshape["open"].get(joint, 0.0) for joint in preshape["closed"]}
    swapped = {"open": preshape["open"] | preshape["closed"], "closed": moved}
    (fault,) = hand_faults(changed(described, **swapped))
    assert "open and closed exchanged" in fault


def test_a_finger_that_never_moves(described):
    path, config = described
    preshape = next(iter(config["preshapes"].values()))
    still = [joint for joint in preshape["closed"] if joint.startswith(("middle", "left"))]
    opened = {j: v for j, v in preshape["open"].items() if j not in still}
    closed = {j: v for j, v in preshape["closed"].items() if j not in still}
    (fault,) = hand_faults(changed(described, open=opened, closed=closed))
    assert fault.startswith(f"Finger '{'middle' if path.stem == 'hand' else 'left'}' never moves")


def test_a_finger_that_rests_in_one_preshape_is_in_order():
    hand = hand_named("icub-left")
    moves = {motion.finger: motion.moves for motion in finger_motions(hand, "pinch")}
    assert moves["ring"] < 0.01 < moves["index"]
    still = replace(hand, preshapes={"pinch": hand.preshapes["pinch"]._replace(rate=np.zeros_like(hand.lower))})
    assert sum("never moves" in fault for fault in hand_faults(still)) == 5


def test_a_hand_of_one_finger(tmp_path):
    path = tmp_path / "hand.xml"
    path.write_text(five_fingers())
    config = propose_hand(path).config.model_dump()
    finger, joints = next(iter(config["fingers"].items()))
    closed = next(iter(config["preshapes"].values()))["closed"]
    config["fingers"] = {finger: joints}
    config["preshapes"] = {"close": {"closed": {joint: angle for joint, angle in closed.items() if joint in joints}}}
    faults = hand_faults(load_hand(path, HandConfig.model_validate(config)))
    assert f"'{finger}' is its only finger: it can press an object against the palm alone." in faults
