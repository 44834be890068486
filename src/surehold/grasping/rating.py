"""Grasps of a file, closed and rated again."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from surehold.errors import InputError
from surehold.grasping.formats.gripper import check_joints, closing_hand, palm_pose
from surehold.grasping.formats.stored import GraspFile, StoredGrasp
from surehold.grasping.grasp import Grasp
from surehold.grasping.pose_noise import RobustQuality, robust_quality
from surehold.grasping.simulator import Simulator

__all__ = ["RatedGrasp", "rated_grasps"]


class RatedGrasp(NamedTuple):
    """A grasp of a file and what it is worth now."""

    stored: StoredGrasp
    grasp: Grasp
    simulator: Simulator  #: that closed it: with the preshape of the hand, or from open to closed as the file says
    robust: RobustQuality | None  #: under pose noise, if it was asked for


def rated_grasps(
    simulator: Simulator,
    file: GraspFile,
    build: Callable[[object], Simulator],
    samples: int = 0,
    seed: int = 0,
) -> Iterator[RatedGrasp]:
    """Close the hand in every grasp of a file, one after the other, and rate it.

    A grasp that surehold stored is closed as it was: with the preshape and its posture. Of another, the joints go from
    their open to their closed values, and on until they touch; where a file holds no joints the hand closes with the
    simulator's preshape.

    Parameters
    ----------
    simulator
        The hand, the object and the options of the rating.
    file
        The grasps.
    build
        Returns the same simulator with another hand.
    samples
        Number of disturbed trials of each grasp, see `robust_quality`; none if 0.
    seed
        Of the disturbances.

    Raises
    ------
    InputError
        If joints or posture of a grasp are not those of the hand; the message names the grasp.
    """
    for stored in file.grasps:
        chosen = simulator
        pose = simulator.object_pose @ palm_pose(simulator.hand, file, stored)
        try:
            if stored.joints:
                check_joints(simulator.hand, stored.joints)
                if stored.quality is None:
                    chosen = build(closing_hand(simulator.hand, stored.pregrasp_joints, stored.joints))
            s1 = stored.posture if chosen is simulator else 0.0
            grasp = chosen.grasp(pose, s1)
        except InputError as error:
            raise InputError(f"grasp {stored.name!r}: {error}") from None
        robust = robust_quality(chosen, pose, s1, n=samples, seed=seed) if samples else None
        yield RatedGrasp(stored, grasp, chosen, robust)
