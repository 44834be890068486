"""The skin of a hand: fixed places on its links and its palm that feel what they touch.

A link is sampled on the capsule that closes on the object; a link that is a box in the hand's model on the faces of
that box, so that a flat pad is felt up to its edges however its inside is filled with capsules. The palm is sampled on
the faces of its boxes that look out of it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.model import Hand

__all__ = ["AROUND", "PITCH", "STATIONS", "box_samples", "link_samples", "palm_samples", "skin_samples"]

Array = NDArray[np.float64]

STATIONS: Final = 5  #: rings of samples along a link
AROUND: Final = 8  #: samples on a ring
PITCH: Final = 0.008  #: largest distance between samples of a flat face [m]


def link_samples(radius: float, length: float, round_end: bool) -> Array:
    """Return skin samples (m, 6) of a link along z: place, outward normal. `round_end` adds the far end's half ball.

    A ring of `AROUND` samples at the middle of each of `STATIONS` equal pieces; on the half ball two rings and the tip.
    """
    rings = [(length * (s + 0.5) / STATIONS, 0.0, AROUND) for s in range(STATIONS)]
    if round_end:
        rings += [(length, np.pi / 6.0, AROUND), (length, np.pi / 3.0, AROUND // 2), (length, np.pi / 2.0, 1)]
    rows = []
    for height, latitude, count in rings:
        angle = 2.0 * np.pi * np.arange(count) / count
        c = np.cos(latitude)
        normal = np.column_stack([c * np.cos(angle), c * np.sin(angle), np.full(count, np.sin(latitude))])
        rows.append(np.column_stack([radius * normal + [0.0, 0.0, height], normal]))
    return np.vstack(rows)


def palm_samples(half: Array, rounding: float) -> Array:
    """Return skin samples (m, 6) of the flat face of a palm's box towards its +z: place and outward normal."""
    reach = half[:2] - rounding
    u, v = (r * np.linspace(-1.0, 1.0, int(np.ceil(2.0 * r / PITCH)) + 1) for r in reach)
    place = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    n = len(place)
    return np.column_stack([place, np.full(n, half[2]), np.zeros((n, 2)), np.ones(n)])


def box_samples(half: Array) -> Array:
    """Return skin samples (m, 6) of all faces of a box, up to the edges: place and outward normal."""
    rows = []
    for axis in range(3):
        turn = np.roll(np.eye(3), axis - 2, axis=1)  # z along the axis
        face = palm_samples(half @ turn, 0.0)
        for side in (-1.0, 1.0):
            rows.append(np.column_stack([side * face[:, :3] @ turn.T, side * face[:, 3:] @ turn.T]))
    return np.vstack(rows)


def skin_samples(hand: Hand) -> Array:
    """Return all skin samples (m, 7) of a hand: number of the body; place [m] and outward normal in its frame.

    The frame of a link is that of the joint that moves it. Samples inside another capsule of the same rigid link, and
    samples of the palm inside another box of it, are left out.
    """
    parts: list[Array] = []
    fingers, joints = hand.radii.shape
    flat = {link for box in hand.boxes for link in box.links}
    for f in range(fingers):
        present = np.flatnonzero(hand.radii[f] > 0.0)
        moving = np.flatnonzero(hand.upper[f] > hand.lower[f])
        last = moving[-1] if len(moving) else 0
        for k in present:
            if f * joints + k in flat:
                continue
            near = hand.chains[f, k, 1:4]
            axes, length = _link_axes(hand, f, int(k))
            local = link_samples(float(hand.radii[f, k]), length, bool(k >= last))
            place, normal = near + local[:, :3] @ axes.T, local[:, 3:] @ axes.T
            parts.append(np.column_stack([np.full(len(place), f * joints + k), place, normal]))
    for box in hand.boxes:
        local = box_samples(box.half)
        place, normal = box.pose[:, 3] + local[:, :3] @ box.pose[:, :3].T, local[:, 3:] @ box.pose[:, :3].T
        parts.append(np.column_stack([_nearest(hand, box.links, place).astype(float), place, normal]))
    for pose, half, rounding in zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True):
        towards = int(np.argmax(np.abs(pose[2, :3])))  # the axis of the box that looks out of the palm
        turn = np.roll(np.eye(3), towards - 2, axis=1) if towards != 2 else np.eye(3)
        turn = turn * np.array([1.0, 1.0, 1.0 if pose[2, towards] > 0.0 else -1.0])
        local = palm_samples(np.abs(half @ turn), float(rounding))
        place, normal = pose[:, 3] + local[:, :3] @ (pose[:, :3] @ turn).T, local[:, 3:] @ (pose[:, :3] @ turn).T
        parts.append(np.column_stack([np.full(len(place), hand.palm), place, normal]))
    samples = np.vstack(parts)
    return samples[~_buried(hand, samples)]


def _nearest(hand: Hand, links: tuple[int, ...], places: Array) -> NDArray[np.int64]:
    """Return which of some links of one frame has its axis nearest to each place (m, 3)."""
    rows = hand.chains.reshape(-1, hand.chains.shape[2])[list(links)]
    near, along = rows[:, None, 1:4], rows[:, None, 4:7] - rows[:, None, 1:4]
    share = np.clip(np.sum((places - near) * along, axis=2) / np.sum(along * along, axis=2), 0.0, 1.0)
    away = np.linalg.norm(places - near - share[:, :, None] * along, axis=2)
    return np.array(links)[np.argmin(away, axis=0)]


def _link_axes(hand: Hand, f: int, k: int) -> tuple[Array, float]:
    """Return the axes (3, 3) of a link's samples, z along the link and x along its bending axis, and its length."""
    along = hand.chains[f, k, 4:7] - hand.chains[f, k, 1:4]
    length = float(np.linalg.norm(along))
    z = along / length
    side = np.array([0.0, 0.0, 1.0])
    if k == 0 and hand.radii.shape[1] > 1:  # the first joint spreads the finger, the second one bends it
        side = hand.chains[f, 0, 7:].reshape(3, 4)[:, 2]
    side = side - (side @ z) * z
    if np.linalg.norm(side) < 0.1:
        side = np.eye(3)[int(np.argmin(np.abs(z)))]
        side = side - (side @ z) * z
    x = side / np.linalg.norm(side)
    return np.column_stack([x, np.cross(z, x), z]), length


def _buried(hand: Hand, samples: Array) -> NDArray[np.bool_]:
    """Return which samples (m, 7) lie inside another capsule of the same rigid link, or box of the palm."""
    fingers, joints = hand.radii.shape
    rest = 0.5 * (hand.lower + hand.upper)
    frames = link_frames(hand.bases, hand.chains, rest)
    rigid = np.cumsum(hand.upper > hand.lower, axis=1)  # links of a finger with the same number move together
    body = samples[:, 0].astype(int)
    buried = np.zeros(len(samples), dtype=bool)
    for f in range(fingers):
        for k in range(joints):
            group = [f * joints + m for m in range(joints) if m != k and rigid[f, m] == rigid[f, k]]
            mine = np.flatnonzero(np.isin(body, group))
            if not len(mine) or hand.radii[f, k] <= 0.0:
                continue
            placed = np.einsum("mij,mj->mi", frames[body[mine], :, :3], samples[mine, 1:4]) + frames[body[mine], :, 3]
            near, far = (frames[f * joints + k] @ np.append(hand.chains[f, k, i : i + 3], 1.0) for i in (1, 4))
            share = np.clip((placed - near) @ (far - near) / ((far - near) @ (far - near)), 0.0, 1.0)
            away = np.linalg.norm(placed - near - share[:, None] * (far - near), axis=1)
            buried[mine] |= away < hand.radii[f, k] - 1e-6
    mine = np.flatnonzero(body == hand.palm)
    for pose, half in zip(hand.palm_poses, hand.palm_half_extents, strict=True):
        inside = np.abs((samples[mine, 1:4] - pose[:, 3]) @ pose[:, :3]) < half - 1e-6
        buried[mine] |= np.all(inside, axis=1)
    return buried
