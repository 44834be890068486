"""Which part of a model is the palm and which are fingers, from the tree of its bodies and joints.

    leaf    a joint below which no other one moves and that moves something that can touch: the last one of a finger
    reach   distance from the first joint that a leaf does not share to the farthest geometry that its leaf moves [m]

The palm is the last body that the chains of all leaves share; rigid bodies above it that can touch belong to it, a
joint that carries several fingers is a part of it and stays at rest. The bars of linkages are no fingers: a leaf that
reaches less than half as far as the farthest one, that is connected to a farther one in a loop, or whose only joint is
coupled to one that reaches 1.3 times as far.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from surehold.errors import InputError, unknown_name

__all__ = ["Skeleton", "skeleton_of"]

_BAR: Final = 0.5  # of the farthest reach: what does not reach that far holds no object
_LONGER: Final = 1.3  # times as far reaches a finger as the bar that is coupled to it
_MOST_OF_ALL: Final = 300  # joints of a robot whose hand is looked for
_MOST_JOINTS, _MOST_CHAIN, _MOST_FINGERS = 32, 8, 8
_TINY: Final = 0.1  # rad; a hand whose joints all turn less than that was written in radians and read in degrees
_HUGE: Final = 5.0 * np.pi  # rad, for limits of two turns each way are usual; what turns farther was written in degrees
_WORDS: Final = {
    "thumb": "thumb|(?<![a-z])th(?=j|base|prox|hub|mid|dis)",
    "index": "index|(?<![a-z])ff(?=j|kn|prox|mid|dis)",
    "middle": "middle_?f|middle|(?<![a-z])mf(?=j|kn|prox|mid|dis)",
    "ring": "(?<![a-z])ring|(?<![a-z])rf(?=j|kn|prox|mid|dis)",
    "little": "little|pinky|(?<![a-z])lf(?=j|kn|meta|prox|mid|dis)",
}


class Skeleton(NamedTuple):
    """The parts of a hand by the names that its model gives them."""

    palm: str  #: body
    fingers: Mapping[str, tuple[str, ...]]  #: joints of each finger, from the palm to the tip
    others: tuple[str, ...]  #: joints below the palm that no finger has
    driving: tuple[str, ...]  #: joints below the palm that actuators drive, if the model closes loops


def skeleton_of(mujoco: Any, model: Any, file: str, palm: str = "") -> Skeleton:
    """Return palm and fingers of a compiled model; only what is below the body `palm`, if one is given.

    Raises
    ------
    InputError
        If the model has no two fingers, more joints than a hand, names that are no UTF-8, or no such body.
    """
    try:
        return _Tree(mujoco, model, file, palm).skeleton()
    except UnicodeDecodeError:
        raise InputError(f"{file!r} has names that are no UTF-8; save it as UTF-8.") from None


class _Tree:
    """The bodies and joints of a model. Joints are numbers of the model; `above` are joints from the palm to a leaf."""

    def __init__(self, mujoco: Any, model: Any, file: str, palm: str):
        self.mujoco, self.model, self.file = mujoco, model, file
        self.parents = [int(b) for b in model.body_parentid]
        self.names = [model.body(b).name or f"body {b}" for b in range(model.nbody)]  # as rest.py names them
        if palm and palm not in self.names:
            raise unknown_name("body", palm, self.names)
        self.top = self.names.index(palm) if palm else 0
        kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        self.hinge = kinds[0]
        fixed = [j for j in range(model.njnt) if model.jnt_limited[j] and not np.ptp(model.jnt_range[j]) > 0.0]
        self.joints = [
            j
            for j in range(model.njnt)
            if model.jnt_type[j] in kinds and j not in fixed and self._is_below(int(model.jnt_bodyid[j]), self.top)
        ]
        self.data = mujoco.MjData(model)
        for j in self.joints:
            self.data.qpos[model.jnt_qposadr[j]] = np.clip(0.0, *self._range(j))
        mujoco.mj_kinematics(model, self.data)

    def skeleton(self) -> Skeleton:
        where = f"below body '{self.names[self.top]}' of {self.file!r}" if self.top else f"in {self.file!r}"
        if not self.joints:
            raise InputError(f"no joint moves {where}: a hand without fingers; give the model of a hand.")
        if len(self.joints) > _MOST_OF_ALL:
            raise InputError(f"{len(self.joints)} joints move {where}; give the model of a hand, or --palm BODY.")
        chains = self._chains()
        palm = self._palm(chains) if chains else self.top
        chains = {
            leaf: [j for j in chain if self._body(j) != palm and self._is_below(self._body(j), palm)]
            for leaf, chain in chains.items()
        }
        leaves = self._fingers(chains)
        if len(leaves) < 2:
            raise InputError(
                f"{len(leaves) or 'no'} finger{'s' * (not leaves)} found {where}, but fingers close against each "
                "other: two are needed that move and can touch; describe another hand by hand (docs: Your own hand)."
            )
        carried = {j for j in self.joints if sum(j in chains[leaf] for leaf in leaves) > 1}
        fingers = sorted([j for j in chains[leaf] if j not in carried] for leaf in leaves)
        moving = [j for finger in fingers for j in finger]
        self._check(fingers, moving, palm)
        named = self._named(fingers)
        below = [j for j in self.joints if self._body(j) != palm and self._is_below(self._body(j), palm)]
        return Skeleton(
            self.names[palm],
            {name: tuple(self._label(j) for j in finger) for name, finger in named.items()},
            tuple(self._label(j) for j in below if j not in moving),
            tuple(self._label(j) for j in self._driven() if j in below),
        )

    def _check(self, fingers: Sequence[Sequence[int]], moving: Sequence[int], palm: int) -> None:
        longest = max(map(len, fingers))
        if len(moving) > _MOST_JOINTS or longest > _MOST_CHAIN or len(fingers) > _MOST_FINGERS:
            raise InputError(
                f"{len(moving)} joints in {len(fingers)} chains move below {self.names[palm]}, up to {longest} in one; "
                f"hands have up to {_MOST_JOINTS} in {_MOST_FINGERS} fingers of {_MOST_CHAIN}: name the --palm BODY."
            )
        hinges = [j for j in moving if self.model.jnt_type[j] == self.hinge and self.model.jnt_limited[j]]
        if hinges and all(np.ptp(self.model.jnt_range[j]) < _TINY for j in hinges):
            most = np.degrees(max(np.ptp(self.model.jnt_range[j]) for j in hinges))
            raise InputError(
                f"the joints of {self.file!r} turn by {most:.2g} degrees at most; if its angles are in radians, write "
                '<compiler angle="radian"/> into the model: MJCF counts in degrees otherwise.'
            )
        far = max(hinges, key=lambda j: np.ptp(self.model.jnt_range[j]), default=-1)
        if far >= 0 and np.ptp(self.model.jnt_range[far]) > _HUGE:
            low, high = self.model.jnt_range[far]
            raise InputError(
                f"joint {self._label(far)!r} of {self.file!r} turns from {low:.4g} to {high:.4g} rad, several turns; "
                "are its limits in degrees? A URDF counts in radians, and a joint without limits has none."
            )

    def _label(self, j: int) -> str:
        return self.model.joint(j).name or f"joint {j}"  # as rest.py names it

    def _range(self, j: int) -> tuple[float, float]:
        if not self.model.jnt_limited[j]:
            return (-np.pi, np.pi) if self.model.jnt_type[j] == self.hinge else (-1.0, 1.0)
        return float(self.model.jnt_range[j][0]), float(self.model.jnt_range[j][1])

    def _body(self, j: int) -> int:
        return int(self.model.jnt_bodyid[j])

    def _above(self, body: int) -> list[int]:
        """Return the bodies from the world to a body."""
        path = [body]
        while path[-1]:
            path.append(self.parents[path[-1]])
        return path[::-1]

    def _is_below(self, body: int, top: int) -> bool:
        return top in self._above(body)

    def _touching(self, bodies: Iterable[int]) -> list[int]:
        """Return the geometries of bodies that can touch."""
        model = self.model
        every = [g for b in bodies for g in range(model.body_geomadr[b], model.body_geomadr[b] + model.body_geomnum[b])]
        return [g for g in every if model.geom_contype[g] or model.geom_conaffinity[g]]

    def _chains(self) -> dict[int, list[int]]:
        """Return all joints above each leaf, from the top to the leaf."""
        above = {}
        for j in self.joints:
            path = self._above(self._body(j))
            above[j] = [i for i in self.joints if self._body(i) in path and (self._body(i) != self._body(j) or i <= j)]
            above[j].sort(key=lambda i: (path.index(self._body(i)), i))
        carriers: set[int] = set()  # joints that carry something that can touch beyond their own link
        leaves = {}
        for j in sorted(self.joints, key=lambda j: -len(above[j])):
            if j in carriers or not self._touching(self._moved(j)):
                continue
            leaves[j] = above[j]
            carriers.update(above[j])
        return leaves

    def _moved(self, j: int) -> list[int]:
        """Return the bodies that j moves and no joint beyond it."""
        below = {b for b in range(self.model.nbody) if self._is_below(b, self._body(j))}
        later = (below & {self._body(i) for i in self.joints}) - {self._body(j)}
        return sorted(b for b in below if not later & set(self._above(b)))

    def _palm(self, chains: Mapping[int, Sequence[int]]) -> int:
        """Return the last body that all chains share, or the highest rigid one above it that can touch."""
        paths = [
            self._above(self.parents[self._body(chain[0])]) if len(chains) == 1 else self._above(self._body(leaf))
            for leaf, chain in chains.items()
        ]
        shared = [bodies[0] for bodies in zip(*paths, strict=False) if len(set(bodies)) == 1]
        palm = shared[-1]
        jointed = {int(b) for b in self.model.jnt_bodyid}
        for body in reversed(shared[:-1]):
            if body in (0, self.parents[self.top]) or body in jointed or shared[shared.index(body) + 1] in jointed:
                break
            if self._touching([body]):
                palm = body
        return palm

    def _fingers(self, chains: Mapping[int, Sequence[int]]) -> list[int]:
        """Return the leaves that are fingers."""
        own = {
            leaf: [j for j in chain if sum(j in other for other in chains.values()) == 1]
            for leaf, chain in chains.items()
            if chain
        }
        reaches = {leaf: self._reach(chain) for leaf, chain in own.items()}
        closed, coupled = self._tied(chains)
        farthest = max(reaches.values(), default=0.0)
        return [
            leaf
            for leaf, reach in reaches.items()
            if reach >= _BAR * farthest
            and not any(reaches.get(other, 0.0) > reach for other in closed[leaf])
            and not (len(own[leaf]) == 1 and any(reaches.get(other, 0.0) > _LONGER * reach for other in coupled[leaf]))
        ]

    def _reach(self, chain: Sequence[int]) -> float:
        origin = self.data.xanchor[chain[0]]
        far = 0.0
        for g in self._touching(self._moved(chain[-1])):
            box = self.model.geom_aabb[g]
            corners = box[:3] + box[3:] * np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
            placed = corners @ self.data.geom_xmat[g].reshape(3, 3).T + self.data.geom_xpos[g]
            far = max(far, float(np.linalg.norm(placed - origin, axis=1).max()))
        return far

    def _tied(self, chains: Mapping[int, Sequence[int]]) -> tuple[dict[int, set[int]], dict[int, set[int]]]:
        """Return the leaves with which each one closes a loop (connected or welded), and those it is coupled to."""
        model, kinds = self.model, self.mujoco.mjtEq
        closed: dict[int, set[int]] = {leaf: set() for leaf in chains}
        coupled: dict[int, set[int]] = {leaf: set() for leaf in chains}
        for e, kind in enumerate(model.eq_type):
            ends = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
            if kind in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)):
                if model.eq_objtype[e] == int(self.mujoco.mjtObj.mjOBJ_SITE):
                    ends = [int(model.site_bodyid[end]) for end in ends]
                tied = closed
                groups = [
                    {leaf for leaf, chain in chains.items() if chain and self._is_below(end, self._body(chain[-1]))}
                    for end in ends
                ]
            elif kind in (int(kinds.mjEQ_JOINT), int(kinds.mjEQ_TENDON)):
                joints = ends if kind == int(kinds.mjEQ_JOINT) else self._of_tendon(ends[0])
                tied = coupled
                groups = [{leaf for leaf, chain in chains.items() if j in chain} for j in joints]
            else:
                continue
            for group in groups:
                for leaf in group:
                    tied[leaf] |= set().union(*groups) - {leaf}
        for middle in coupled:  # two bars that follow a third joint are coupled, too
            for leaf in coupled:
                if middle in coupled[leaf]:
                    coupled[leaf] |= coupled[middle] - {leaf}
        return closed, coupled

    def _of_tendon(self, t: int) -> list[int]:
        """Return the joints of a fixed tendon."""
        wraps = range(int(self.model.tendon_adr[t]), int(self.model.tendon_adr[t] + self.model.tendon_num[t]))
        kind = int(self.mujoco.mjtWrap.mjWRAP_JOINT)
        return [int(self.model.wrap_objid[w]) for w in wraps if self.model.wrap_type[w] == kind]

    def _named(self, fingers: Sequence[Sequence[int]]) -> dict[str, list[int]]:
        """Return the fingers by name: thumb, index, .. where the model's names say so."""
        found = []
        for finger in fingers:
            bodies = [b for b in range(self.model.nbody) if self._is_below(b, self._body(finger[0]))]
            text = [name.lower() for name in (*map(self._label, finger), *(self.names[b] for b in bodies))]
            counts = {word: sum(bool(re.search(pattern, name)) for name in text) for word, pattern in _WORDS.items()}
            best = max(counts, key=lambda word: counts[word])
            sides = [side for side in ("left", "right") if any(side in name for name in text)]
            found.append(best if counts[best] else sides[0] if len(sides) == 1 else "")
        unique = [name if name and found.count(name) == 1 else f"finger_{n + 1}" for n, name in enumerate(found)]
        return {name: list(finger) for name, finger in zip(unique, fingers, strict=True)}

    def _driven(self) -> list[int]:
        """Return the joints that actuators drive, one by one or by tendons, if an equality closes a loop."""
        model, mujoco = self.model, self.mujoco
        if not any(kind != int(mujoco.mjtEq.mjEQ_JOINT) for kind in model.eq_type):
            return []
        driven: list[int] = []
        for kind, target in zip(model.actuator_trntype, model.actuator_trnid[:, 0], strict=True):
            if kind == int(mujoco.mjtTrn.mjTRN_JOINT):
                driven.append(int(target))
            elif kind == int(mujoco.mjtTrn.mjTRN_TENDON):
                driven += self._of_tendon(int(target))
        return driven
