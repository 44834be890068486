"""How hard each joint pushes while a hand squeezes: forces that balance on the object, or every joint as it can.

    W    wrenches of the friction cones' edges at the contacts, in units of force, (m, 6)
    x    how much of each edge, >= 0 and of sum 1, (m,): the normal forces add up to 1
    N    which edges are those of a contact: N x are the normal forces, (n, m)
    T    torques of the joints per unit of each edge (J' f), divided by the largest that each joint can exert, (k, m)

Five fingers that all push as hard as they can carry off what they hold: four of them are stronger than a thumb. A hand
that feels its contacts and commands torques squeezes with forces that balance. Of these the joints take torques that
strain them little, and the skin presses as evenly as that leaves,

    min over x  |T x|^2 / max T^2 + n |N x|^2 + B^2 (|W' x|^2 + (sum x - 1)^2),  B large,

a nonnegative least-squares problem whose T x and N x are unique. Least strain alone puts all force on as few of a
hundred contacts as balance needs, and where it passes the joints at a small lever: rigid links touch somewhere beside,
and the object slips away. Contacts without balance get the forces that leave the least wrench. Then all are scaled
until the first joint is at its limit. Bilevel grasp synthesis squeezes in a similar way (Chen et al. 2024, BODex);
internal forces: Kerr and Roth 1986.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.grasp import Grasp
from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.simulator import Simulator
from surehold.grasping.wrench.friction_cones import contact_wrenches

__all__ = ["balanced_torques"]

Array = NDArray[np.float64]

_BALANCE: Final = 1000.0  # B by the largest strain: rather all of that than a wrench of a thousandth of the squeeze
_RESERVE: Final = 0.8  # share of the friction that the squeeze relies on: the rest is left for the load
_ROUNDING: Final = 1e-6  # torques by the largest of any contact below which they are none
_NEAR: Final = 0.5  # weight of a soft touch from which on the skin is pressed [1 - gap / depth]


def balanced_torques(simulator: Simulator, grasp: Grasp, limits: Array) -> tuple[Array, float]:
    """Return torques (f, j) of the joints as shares of their limits, the largest 1, and the wrench left out of balance.

    Parameters
    ----------
    simulator
        Whose hand, object and friction are meant.
    grasp
        A closed grasp of that simulator.
    limits
        Largest torque of each joint [N m], or force of one that slides [N], (f, j); 0 for joints that do not move.

    Returns
    -------
    torques, residual
        Of a hand with fewer than two contacts all torques are 0 and the residual is 1; all are 0, too, where forces
        balance that need no torque, such as those of one finger on both sides of an edge. The residual is the length of
        W' x, in units of the sum of the normal forces; torques of length, as everywhere, by half the object's size.
    """
    from scipy.optimize import nnls

    hand, torques = simulator.hand, np.zeros(limits.shape)
    contacts = simulator.contacts_at(grasp.pose, grasp.joints)
    near = contacts.weights > _NEAR
    points, normals, bodies = contacts.points[near], contacts.normals[near], contacts.bodies[near]
    if len(points) < 2:
        return torques, 1.0
    wrenches = contact_wrenches(
        points,
        normals,
        friction=_RESERVE * simulator.friction,
        torque_length=simulator.object.torque_length,
        origin=simulator.object.center_of_mass,
    )
    per_contact = len(wrenches) // len(points)
    palm = grasp.pose.inverse()
    places, forces = palm.apply(points), wrenches[:, :3] @ palm.rotation.T  # in the palm frame, as the joints
    frames = link_frames(hand.bases, hand.chains, np.ascontiguousarray(grasp.joints))
    of_edge = np.repeat(np.arange(len(points)), per_contact)
    strain = _strains(hand.chains, frames, limits, places[of_edge], forces, bodies[of_edge])
    most = np.abs(strain).max() or 1.0
    even = most * np.sqrt(len(points)) * np.repeat(np.eye(len(points)), per_contact, axis=1)
    heavy = _BALANCE * most
    system = np.vstack([strain, even, heavy * wrenches.T, np.full(len(wrenches), heavy)])
    goal = np.zeros(len(system))
    goal[-1] = heavy
    x, _ = nnls(system, goal, maxiter=30 * len(wrenches))
    if not x.any():
        return torques, 1.0
    torques = (strain @ x).reshape(limits.shape)
    largest = np.abs(torques).max()
    if largest < _ROUNDING * most:  # scaled up, rounding would be the whole torque, in any direction
        torques, largest = np.zeros(limits.shape), 1.0
    return torques / largest, float(np.linalg.norm(wrenches.T @ x) / x.sum())


def _strains(
    chains: Array, frames: Array, limits: Array, points: Array, forces: Array, bodies: NDArray[np.int64]
) -> Array:
    """Return the torque of each joint by its limit (f j, m) for forces (m, 3) on the object, each of one body."""
    fingers, joints = limits.shape
    axes, origins = frames[:, :, 2], frames[:, :, 3]
    turning = np.einsum("ka,mka->km", axes, np.cross(points[:, None] - origins, forces[:, None]))
    pushed = np.where((chains[:, :, 0] > 0.0).reshape(-1, 1), axes @ forces.T, turning)
    number = np.arange(fingers * joints)
    carries = (number[:, None] // joints == bodies // joints) & (number[:, None] <= bodies)  # links beyond a joint
    carries &= (bodies < fingers * joints) & (limits.reshape(-1, 1) > 0.0)
    return np.where(carries, pushed, 0.0) / np.where(limits > 0.0, limits, 1.0).reshape(-1, 1)
