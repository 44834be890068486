"""The closing of the hand once more, with the exact distances of coal instead of our field and our clearances."""

import heapq

import coal
import numpy as np
from exact_mesh import ExactMesh, capsule_pair

from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.model import CLOSED
from surehold.grasping.hand.synergy import closing_motion

_TOUCH = 1e-5  # m


class ExactClosing:
    def __init__(self, simulator):
        self.simulator, self.hand = simulator, simulator.hand
        self.mesh = ExactMesh(simulator.object)
        self.reach = self.hand.reach()
        fingers, joints = self.hand.radii.shape
        links = [(f, k) for f in range(fingers) for k in range(joints) if self.hand.radii[f, k] > 0.0]
        self.pairs = [(link, None) for link in links]
        self.pairs += [(link, "palm") for link in links]
        self.pairs += [(a, b) for a in links for b in links if a[0] < b[0]]

    def joints(self, pose, s1):
        """Return the joint angles (f, j) of the closed hand at a pose in the object's frame."""
        motion = closing_motion(self.hand, s1, self.simulator.preshape)
        stop = np.full(self.hand.radii.shape, np.inf)

        def angles(t):
            return np.clip(motion.start + motion.rate * np.minimum(t, stop), motion.lower, motion.upper)

        def speed(link, t):
            f, k = link
            moving = (stop[f, : k + 1] > t) & (angles(t + 1e-9)[f, : k + 1] != angles(CLOSED)[f, : k + 1])
            return float(np.sum(np.abs(motion.rate[f, : k + 1]) * self.reach[f, : k + 1, k] * moving))

        waiting = [(0.0, i) for i in range(len(self.pairs))]
        resting = [pair[1] is not None for pair in self.pairs]
        heapq.heapify(waiting)
        while waiting:
            t, i = heapq.heappop(waiting)
            if t >= CLOSED:
                break
            a, b = self.pairs[i]
            bodies = [a, b] if isinstance(b, tuple) else [a]
            v = sum(speed(body, t) for body in bodies)
            if v == 0.0:
                continue
            if np.array_equal(angles(t)[[f for f, _ in bodies]], angles(0.0)[[f for f, _ in bodies]]):
                later = t + 0.02  # all joints still stand at the end of their range
                if np.array_equal(angles(later)[[f for f, _ in bodies]], angles(0.0)[[f for f, _ in bodies]]):
                    heapq.heappush(waiting, (later, i))
                    continue
            gap = self._gap(pose, angles(t), a, b)
            if gap > _TOUCH:
                resting[i] = False
                heapq.heappush(waiting, (t + (gap - 0.5 * _TOUCH) / v, i))
            elif not resting[i]:
                for f, k in bodies:
                    if speed((f, k), t) > 0.0:
                        last = k if self.simulator.closing == "adaptive" else stop.shape[1] - 1
                        stop[f, : last + 1] = np.minimum(stop[f, : last + 1], t)
        return angles(CLOSED)

    def _gap(self, pose, angles, a, b):
        hand, joints = self.hand, self.hand.radii.shape[1]
        ends = link_ends(hand.bases, hand.chains, angles)
        near, far = ends[joints * a[0] + a[1]]
        radius = hand.radii[a]
        if b is None:
            return self.mesh.capsule(*pose.apply([near, far]), radius)
        if isinstance(b, tuple):
            return capsule_pair((near, far), ends[joints * b[0] + b[1]], radius)
        gaps = []
        for frame, half, rounding in zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True):
            core = coal.Box(*(2.0 * (half - rounding)))
            gaps.append(
                self.mesh.between(core, coal.Transform3s(frame[:, :3], frame[:, 3]), near, far, radius) - rounding
            )
        return min(gaps)
