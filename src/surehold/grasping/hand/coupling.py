"""Joints that follow others: as the description says, and as the model does.

    q   joint angles or shifts, (j,), by the joints' numbers in the model, rad or m      r   q in the model's own pose
    p   coefficients of a polynomial, lowest first                                       s   q where springs are slack
    c   coefficients of a tendon

In the order in which they count:

1. what the description names, and its own `coupling`;
2. an equality of two joints (MJCF `equality/joint`, URDF `mimic`): q1 - r1 = sum_k p_k (q2 - r2)^k;
3. a fixed tendon that an actuator pulls: its force f loads joint i with c_i f, so that joints of equal stiffness share
   its travel by their coefficients, (q_i - s_i) / c_i = (q_l - s_l) / c_l; the first one l that is named leads;
4. the model's other equalities (`connect`, `weld`, `tendon`), which close loops: the joints of the fingers that are
   still free are moved the least way that meets them; where that does not do, all joints of the model that are free.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.rest import RestingModel

__all__ = ["JointCouplings"]

Array = NDArray[np.float64]
_MET: Final = 1e-4  #: a loop that is open by less is closed [m, rad]
_STEPS: Final = 50
_STRIDE: Final = 0.1  #: of the joints that lead, while those that follow in a loop are sought [rad, m]


class _Leader(NamedTuple):
    joint: int  #: -1 for a joint that is held
    polynomial: Array  #: (k,) of the leader's angle from its reference
    references: tuple[float, float] = (0.0, 0.0)  #: of follower and leader


class JointCouplings:
    """The couplings of a hand's description and model."""

    def __init__(self, rest: RestingModel):
        self._rest, self._mujoco, self._model = rest, rest.mujoco, rest.model
        self._data = rest.mujoco.MjData(rest.model)
        self._described: dict[int, _Leader] = {}
        for follower, coupling in rest.config.coupling.items():
            joints = [self._number(name) for name in (follower, coupling.follows)]
            self._described[joints[0]] = _Leader(joints[1], np.array([coupling.offset, coupling.factor]))
        kinds = rest.mujoco.mjtEq
        self._equal: dict[int, _Leader] = {}
        self._loops = []
        for e in np.flatnonzero(self._data.eq_active):
            if self._model.eq_type[e] != int(kinds.mjEQ_JOINT):
                self._loops.append(int(e))
                continue
            first, second = int(self._model.eq_obj1id[e]), int(self._model.eq_obj2id[e])
            references = self._reference(first), self._reference(second) if second >= 0 else 0.0
            self._equal.setdefault(first, _Leader(second, self._model.eq_data[e, :5].copy(), references))
        self._tendons = [dict(tendon) for tendon in self._pulled_tendons()]
        self._model.opt.jacobian = int(self._mujoco.mjtJacobian.mjJAC_DENSE)
        self._model.opt.disableflags |= int(self._mujoco.mjtDisableBit.mjDSBL_CONTACT)  # not needed, and slow

    def leaders(self) -> set[str]:
        """Return the joints that no finger needs to have, because others can follow them."""
        leaders = {leader.joint for leader in (*self._equal.values(), *self._described.values())} - {-1}
        leaders |= {j for tendon in self._tendons for j in tendon}
        if self._loops:
            leaders |= {j for j in range(self._model.njnt) if self._rest.moves(j)}
        return {self._rest.joint_names[j] for j in leaders}

    def followers(self) -> set[str]:
        """Return the joints that follow others whatever is named, unless they are named themselves."""
        return {self._rest.joint_names[j] for j in self._equal | self._described}

    def followed(self, names: Iterable[str]) -> list[str]:
        """Return the joints at the head of those that some follow by an equality, in the order of the followers."""
        heads = []
        for name in names:
            j, seen = self._rest.joint_ids[name], set[int]()
            while j in self._equal and j not in seen:
                seen.add(j)
                j = self._equal[j].joint
            if seen and j >= 0 and j not in self._equal:
                heads.append(self._rest.joint_names[j])
        return list(dict.fromkeys(heads))

    def posture(self, named: Mapping[str, float], start: Array, what: str) -> Array:
        """Return all joints (j,): those named, those that follow them, the others where they `start` (j,).

        Raises
        ------
        InputError
            If a joint follows itself, or a loop of the model cannot be closed; `what` names the posture.
        """
        q = start.copy()
        for name, value in named.items():
            q[self._rest.joint_ids[name]] = value
        done = {self._rest.joint_ids[name] for name in named}
        follows = {j: leader for j, leader in self._equal.items() if j not in done} | self._described
        for tendon in self._tendons:
            lead = next((j for j in tendon if j in done), None)
            for j in tendon:
                if lead is not None and j not in done and j not in follows:
                    ratio = np.array([0.0, tendon[j] / tendon[lead]])
                    slack = self._model.qpos_spring[self._model.jnt_qposadr[[j, lead]]]
                    follows[j] = _Leader(lead, ratio, (float(slack[0]), float(slack[1])))
        for j in follows:
            self._follow(j, follows, q, done, ())
        if self._loops:
            self._move_loops(q, start, done, what)
        return q

    def range(self, j: int) -> tuple[float, float]:
        """Return the ends of a joint's range; of a follower that its leader never takes there, where it takes it.

        Public models have mimicking joints that turn the other way than their limits say.
        """
        low, high = self._rest.range(j)
        leader = self._described.get(j) or self._equal.get(j)
        if leader is None or leader.joint < 0:
            return low, high
        away = np.linspace(*self._rest.range(leader.joint), 33) - leader.references[1]
        taken = leader.references[0] + np.polynomial.polynomial.polyval(away, leader.polynomial)
        first, last = float(taken.min()), float(taken.max())
        meets = min(last, high) - max(first, low) > 0.1 * (last - first)
        return (low, high) if meets else (first, last)

    def _number(self, name: str) -> int:
        if name not in self._rest.joint_ids:
            raise unknown_name("joint of coupling", name, self._rest.joint_names)
        return self._rest.joint_ids[name]

    def _reference(self, j: int) -> float:
        return float(self._model.qpos0[self._model.jnt_qposadr[j]])

    def _pulled_tendons(self) -> Iterator[list[tuple[int, float]]]:
        """Yield joints and coefficients of the fixed tendons that actuators pull."""
        model = self._model
        for t in sorted(set(model.actuator_trnid[model.actuator_trntype == int(self._mujoco.mjtTrn.mjTRN_TENDON), 0])):
            wraps = range(int(model.tendon_adr[t]), int(model.tendon_adr[t] + model.tendon_num[t]))
            if all(model.wrap_type[w] == int(self._mujoco.mjtWrap.mjWRAP_JOINT) for w in wraps):
                yield [(int(model.wrap_objid[w]), float(model.wrap_prm[w])) for w in wraps if model.wrap_prm[w]]

    def _follow(self, j: int, follows: Mapping[int, _Leader], q: Array, done: set[int], below: tuple[int, ...]) -> None:
        """Put joint j where its leader takes it, after its leader."""
        if j in done or j not in follows:
            return
        if j in below and j not in self._described:  # two that follow each other stay, unless one is named
            return
        if j in below:
            raise InputError(f"hand '{self._rest.config.name}': '{self._rest.joint_names[j]}' follows itself.")
        leader = follows[j]
        away = 0.0
        if leader.joint >= 0:
            self._follow(leader.joint, follows, q, done, (*below, j))
            away = q[leader.joint] - leader.references[1]
        q[j] = leader.references[0] + np.polynomial.polynomial.polyval(away, leader.polynomial)
        done.add(j)

    def _move_loops(self, q: Array, start: Array, done: set[int], what: str) -> None:
        """Move free joints until the loops are closed where the others are moved from `start` (j,) to q (j,).

        In strides, each from where the last two point to: at once, half a radian ended whole turns or on the other
        branch of a linkage, and where its bars are in line the branches meet.
        """
        leading = sorted(done)
        end = q[leading]
        way = end - start[leading]
        parts = max(1, int(np.ceil(np.abs(way).max(initial=0.0) / _STRIDE)))
        before, gap, worst = q.copy(), 0.0, 0
        for part in range(1, parts + 1):
            guess = 2.0 * q - before
            guess[leading] = end if part == parts else start[leading] + part / parts * way
            before[:], q[:] = q, guess
            gap, worst = self._close_loops(q, done)
            if gap >= _MET:
                before[:] = q
        if gap >= _MET:
            name = self._model.eq(worst).name or f"number {worst}"
            raise InputError(
                f"hand '{self._rest.config.name}': {what} leaves the model's loop '{name}' open by {1e3 * gap:.3g} mm; "
                "give angles that its links can reach."
            )

    def _close_loops(self, q: Array, done: set[int]) -> tuple[float, int]:
        """Move free joints until the model's loops are closed: Gauss-Newton, each step the shortest one.

        Return by how much the loops stay open [m, rad], and the equality that does most.
        """
        fingers = [j for joints in self._rest.fingers.values() for j in joints if j not in done]
        others = [j for j in range(self._model.njnt) if self._rest.moves(j) and j not in done]
        gap, worst = 0.0, 0
        for free in (fingers, others):
            columns = self._model.jnt_dofadr[free]
            for _ in range(_STEPS):
                gaps, slopes, ids = self._loop_gaps(q)
                felt = np.abs(slopes[:, columns]).max(axis=1, initial=0.0) > 1e-9
                if not felt.any():
                    return 0.0, 0
                gap, worst = float(np.abs(gaps[felt]).max()), int(ids[felt][np.abs(gaps[felt]).argmax()])
                if gap < 1e-2 * _MET:
                    return gap, worst
                q[free] -= np.linalg.lstsq(slopes[np.ix_(felt, columns)], gaps[felt], rcond=1e-6)[0]
            if gap < _MET:
                break
        return gap, worst

    def _loop_gaps(self, q: Array) -> tuple[Array, Array, NDArray[np.int32]]:
        """Return residuals (r,), Jacobian (r, v) and equalities (r,) of the loops."""
        model, data = self._model, self._data
        for j in range(model.njnt):
            if self._rest.moves(j):
                data.qpos[model.jnt_qposadr[j]] = q[j]
        self._mujoco.mj_fwdPosition(model, data)
        rows = np.flatnonzero(
            (data.efc_type == int(self._mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & np.isin(data.efc_id, self._loops)
        )
        return data.efc_pos[rows].copy(), data.efc_J.reshape(-1, model.nv)[rows].copy(), data.efc_id[rows]
