"""A hand of one's own: an MJCF or URDF model, read by MuJoCo, and its description (hand_config.py).

Fingers close on capsules. The model's collision geometries become capsules as follows: a capsule stays what it is; a
sphere is a capsule of no length; a box, cylinder or ellipsoid is covered by parallel capsules whose radius is its
smallest half extent, no farther apart than that radius (the hollows between them are at most 0.14 radius deep); a mesh
is cut across its longest axis into pieces of at most 20 mm, each covered like a box. Geometries of the palm, and of
what moves with it, become boxes with round edges. A model without collision geometries on a finger is refused.

Nothing in a model is executed, and no plugin is loaded; meshes are read from the folder that the model names.
"""

import importlib
import importlib.util
import stat
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.configuration import HandConfig, ModelFile, PreshapeConfig, read_hand_config
from surehold.grasping.hand.cover import SHORTEST, Capsule, cover_box, cover_mesh
from surehold.grasping.hand.model import CLOSED, Hand, HandModel, Preshape, chain_row

__all__ = ["load_hand", "packaged_hand", "read_model"]

Array = NDArray[np.float64]
_MOST_BYTES: Final = 64 * 2**20
_S1_TRIES: Final = 6
_SMALLEST, _LARGEST = 0.01, 1.0  # of a hand, from the palm to the farthest tip [m]


def load_hand(model: str | Path, config: str | Path | HandConfig) -> Hand:
    """Return the hand of a model file (.xml of MuJoCo or .urdf) and its description.

    Raises
    ------
    InputError
        As `read_model`, or if the description does not fit the model: the message lists what the model has.
    """
    described = config if isinstance(config, HandConfig) else read_hand_config(config)
    mujoco, compiled = read_model(model)
    try:
        builder = _Builder(mujoco, compiled, described)
        return replace(builder.hand(), model=builder.source(str(model)))
    except UnicodeDecodeError:
        raise InputError(f"{str(model)!r} has names that are no UTF-8; save it as UTF-8.") from None


def read_model(model: str | Path) -> tuple[Any, Any]:
    """Return MuJoCo and the compiled model of a file (.xml of MuJoCo or .urdf).

    Raises
    ------
    InputError
        If MuJoCo is not installed, or the file cannot be read.
    """
    try:
        mujoco: Any = importlib.import_module("mujoco")  # its names are not in its type information
    except ImportError:
        raise InputError("reading a hand needs MuJoCo; install it with: pip install 'surehold[mujoco]'.") from None
    path = Path(model)
    if path.suffix.lower() not in (".xml", ".urdf", ".mjcf"):
        raise InputError(f"{str(model)!r} is no model of a hand; give an .xml (MJCF) or .urdf file.")
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device might never end
            raise InputError(f"{str(model)!r} is no regular file; give a model on disk.")
        if status.st_size > _MOST_BYTES:
            raise InputError(f"{str(model)!r} is larger than 64 MB; give a model of the hand alone.")
        return mujoco, _compiled(mujoco, path)
    except OSError as error:
        raise InputError(f"cannot read {str(model)!r}: {error.strerror}.") from None
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"{str(model)!r} is not a model that MuJoCo can read: {reason}.") from None


def packaged_hand(config: str | Path) -> Hand:
    """Return the hand of a description that names its model: a file, or one of an installed package.

    Raises
    ------
    InputError
        As `load_hand`, or if the package is not installed; nothing is ever downloaded.
    """
    described = read_hand_config(config)
    where = described.model
    if where is None:
        raise InputError(f"{str(config)!r} does not say where its model is; give --hand MODEL beside --hand-config.")
    if isinstance(where, ModelFile):
        return load_hand(Path(config).parent / where.file, described)
    found = importlib.util.find_spec(where.package)
    folders = [] if found is None else list(found.submodule_search_locations or [])
    for folder in folders:
        if (Path(folder) / where.path).is_file():
            return load_hand(Path(folder) / where.path, described)
    raise InputError(
        f"hand '{described.name}' is described here, but its model comes with the package {where.distribution}, which "
        f"is not installed; pip install --no-deps {where.distribution} (nothing is downloaded otherwise)."
    )


def _compiled(mujoco: Any, path: Path) -> Any:
    """Return the model of a file. MuJoCo's warnings, of inertias and the like, do not matter here."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)  # it would write a log into the working directory
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            spec = mujoco.MjSpec.from_file(str(path))
            spec.compiler.fusestatic = False  # bodies keep their names
            # Nothing moves by forces here: inertias that no body can have shall not refuse a hand.
            spec.compiler.balanceinertia, spec.compiler.boundmass, spec.compiler.boundinertia = True, 1e-6, 1e-12
            return spec.compile()
    finally:
        mujoco.set_mju_user_warning(before)


class _Builder:
    """The model at rest, every joint at 0 or at the nearest end of its range, seen from the palm."""

    def __init__(self, mujoco: Any, model: Any, config: HandConfig):
        self.mujoco, self.model, self.config = mujoco, model, config
        self.data = mujoco.MjData(model)
        self.joint_ids = {model.joint(j).name: j for j in range(model.njnt)}
        self.body_ids = {model.body(b).name: b for b in range(model.nbody)}
        if not model.njnt:
            raise InputError(f"the model of hand '{config.name}' has no joint; give a hand whose fingers move.")
        self.fingers = {finger: [self._joint(name) for name in names] for finger, names in config.fingers.items()}
        moving = [j for joints in self.fingers.values() for j in joints]
        if len(set(moving)) != len(moving):
            twice = next(model.joint(j).name for j in moving if moving.count(j) > 1)
            raise InputError(f"hand '{config.name}' names joint '{twice}' twice; a joint moves one finger.")
        for j in range(model.njnt):
            if self._moves(j):
                rest = 0.0 if j in moving else float(np.clip(0.0, *self._range(j)))
                self.data.qpos[model.jnt_qposadr[j]] = rest
        mujoco.mj_kinematics(model, self.data)
        palm = config.palm
        if palm.body not in self.body_ids:
            raise unknown_name("body", palm.body, [name for name in self.body_ids if name])
        self.palm_body = self.body_ids[palm.body]
        z, x = np.asarray(palm.z), np.asarray(palm.x)
        if np.linalg.norm(z) < 1e-6 or np.linalg.norm(np.cross(z, x)) < 1e-3 * np.linalg.norm(z) * np.linalg.norm(x):
            raise InputError(f"hand '{config.name}': palm.x {palm.x} and palm.z {palm.z} must point in two directions.")
        z = z / np.linalg.norm(z)
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        turn = self.data.xmat[self.palm_body].reshape(3, 3)
        self.turn = turn @ np.column_stack([x, np.cross(z, x), z])
        self.origin = self.data.xpos[self.palm_body] + turn @ np.asarray(palm.origin)
        self.of_body, self.of_palm = self._owners()

    def hand(self) -> Hand:
        """Return the hand."""
        config = self.config
        rows = [self._finger(finger, joints) for finger, joints in self.fingers.items()]
        self._check_size(rows)
        longest = max(len(row["chain"]) for row in rows)
        f = len(rows)
        chains, radii = np.zeros((f, longest, 19)), np.zeros((f, longest))
        lower, upper = np.zeros((f, longest)), np.zeros((f, longest))
        names = [["" for _ in range(longest)] for _ in rows]
        links = [[f"{finger} {k + 1}" for k in range(longest)] for finger in self.fingers]
        chains[:, :] = chain_row(np.zeros(3), np.array([SHORTEST, 0.0, 0.0]), np.eye(3, 4))
        for i, row in enumerate(rows):
            n = len(row["chain"])
            chains[i, :n], radii[i, :n] = row["chain"], row["radii"]
            for k, j in enumerate(row["joints"]):
                if j is not None:
                    names[i][k] = self.model.joint(j).name
                    lower[i, k], upper[i, k] = self._range(j)
            links[i][:n] = row["links"]
        boxes = self._palm_boxes()
        flat = tuple(name for row in names for name in row)
        return Hand(
            name=config.name,
            bases=np.stack([row["base"] for row in rows]),
            chains=chains,
            radii=radii,
            lower=lower,
            upper=upper,
            palm_poses=np.stack([box[0] for box in boxes]) if boxes else np.empty((0, 3, 4)),
            palm_half_extents=np.stack([box[1] for box in boxes]) if boxes else np.empty((0, 3)),
            palm_roundings=np.array([box[2] for box in boxes]),
            grasp_center=np.asarray(config.palm.grasp_center),
            finger_names=tuple(self.fingers),
            link_names=tuple(name for row in links for name in row),
            joint_names=flat,
            preshapes={name: self._preshape(name, p, flat, lower, upper) for name, p in config.preshapes.items()},
            finger_force=config.finger_force,
            friction=config.friction,
            sources={str(number): source for number, source in config.sources.items()},
        )

    def source(self, file: str) -> HandModel:
        """Return the names and frames of the model at rest."""
        rotation = self.data.xmat[self.palm_body].reshape(3, 3)
        inside = np.column_stack([rotation.T @ self.turn, rotation.T @ (self.origin - self.data.xpos[self.palm_body])])
        order = sorted((int(self.model.jnt_qposadr[j]), j) for j in self.joint_ids.values() if self._moves(j))
        return HandModel(
            file,
            self.config.palm.body,
            inside,
            np.column_stack([self.turn, self.origin]),
            tuple(self.model.joint(j).name for _, j in order),
            tuple(float(self.data.qpos[place]) for place, _ in order),
        )

    def _moves(self, j: int) -> bool:
        return self.model.jnt_type[j] in (int(self.mujoco.mjtJoint.mjJNT_HINGE), int(self.mujoco.mjtJoint.mjJNT_SLIDE))

    def _check_size(self, rows: list[dict[str, Any]]) -> None:
        """Raise InputError for a hand that is no hand by its size."""
        name, palm = self.config.name, self.config.palm
        sizes = []
        for row in rows:
            offsets = row["chain"][:, 7:].reshape(-1, 3, 4)[:, :, 3]
            along = np.linalg.norm(offsets, axis=1).sum() + np.linalg.norm(row["chain"][:, 4:7], axis=1).max()
            sizes.append(float(np.linalg.norm(row["base"][:, 3]) + along))
        size = float(np.max(sizes))
        if not np.isfinite(size):
            raise InputError(f"the model of hand '{name}' has numbers that are not finite; repair it.")
        if not _SMALLEST <= size <= _LARGEST:
            raise InputError(
                f"hand '{name}' reaches {1e3 * size:.3g} mm from its palm's origin; MuJoCo takes lengths as meters, "
                f"and a hand is {1e3 * _SMALLEST:g} to {1e3 * _LARGEST:g} mm long."
            )
        far = float(np.linalg.norm(palm.grasp_center))
        if far > 2.0 * size:
            raise InputError(
                f"hand '{name}': palm.grasp_center is {1e3 * far:.3g} mm away, the fingers reach {1e3 * size:.3g} mm; "
                "give it in meters, between palm and fingers."
            )

    def _joint(self, name: str) -> int:
        if name not in self.joint_ids:
            raise unknown_name("joint", name, [known for known in self.joint_ids if known])
        j = self.joint_ids[name]
        if not self._moves(j):
            raise InputError(f"joint '{name}' of hand '{self.config.name}' neither turns nor slides about one axis.")
        return j

    def _range(self, j: int) -> tuple[float, float]:
        if not self.model.jnt_limited[j]:
            turns = self.model.jnt_type[j] == int(self.mujoco.mjtJoint.mjJNT_HINGE)
            return (-np.pi, np.pi) if turns else (-1.0, 1.0)
        return float(self.model.jnt_range[j][0]), float(self.model.jnt_range[j][1])

    def _above(self, body: int) -> Iterator[int]:
        while True:
            yield body
            if body == 0:
                return
            body = int(self.model.body_parentid[body])

    def _owners(self) -> tuple[dict[int, tuple[str, int]], list[int]]:
        """Return which finger and joint moves each body (the last joint above it), and the bodies of the palm."""
        last = {}
        for finger, joints in self.fingers.items():
            for k, j in enumerate(joints):
                body = int(self.model.jnt_bodyid[j])
                if k and int(self.model.jnt_bodyid[joints[k - 1]]) not in self._above(body):
                    before = self.model.joint(joints[k - 1]).name
                    raise InputError(
                        f"finger '{finger}': joint '{self.model.joint(j).name}' is not moved by '{before}'; name the "
                        "joints of a finger from the palm to the tip."
                    )
                if self.palm_body not in self._above(body):
                    raise InputError(
                        f"finger '{finger}': joint '{self.model.joint(j).name}' is not below the palm "
                        f"'{self.config.palm.body}'."
                    )
                last[body] = (finger, k)
        of_body: dict[int, tuple[str, int]] = {}
        of_palm = []
        for body in range(self.model.nbody):
            above = list(self._above(body))
            owner = next((last[b] for b in above if b in last), None)
            if owner is not None:
                of_body[body] = owner
            elif self.palm_body in above:
                of_palm.append(body)
        return of_body, of_palm

    def _placed(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        return self.turn.T @ (position - self.origin), self.turn.T @ rotation

    def _finger(self, finger: str, joints: list[int]) -> dict[str, Any]:
        """Return base (3, 4), chain (n, 19), radii (n,), joints and link names of a finger."""
        frames = []
        for j in joints:
            z = self.data.xaxis[j]
            x = np.eye(3)[int(np.argmin(np.abs(z)))]
            x = x - (x @ z) * z
            x = x / np.linalg.norm(x)
            frames.append(self._placed(self.data.xanchor[j], np.column_stack([x, np.cross(z, x), z])))
        chain, radii, owners, links = [], [], [], []
        touching = 0
        for k, j in enumerate(joints):
            p, r = frames[k]
            capsules = [
                (name, r.T @ (near - p), r.T @ (far - p), radius)
                for name, near, far, radius in self._capsules(finger, k)
            ]
            touching += len(capsules)
            if not capsules:
                capsules = [(f"{finger} {k + 1}", np.zeros(3), np.array([SHORTEST, 0.0, 0.0]), 0.0)]
            if k + 1 < len(joints):
                q, s = frames[k + 1]
                offset = np.column_stack([r.T @ s, r.T @ (q - p)])
            else:
                offset = np.eye(3, 4)
            slides = self.model.jnt_type[j] == int(self.mujoco.mjtJoint.mjJNT_SLIDE)
            for i, (name, near, far, radius) in enumerate(capsules):
                end = i + 1 == len(capsules)
                chain.append(chain_row(near, far, offset if end else np.eye(3, 4), bool(slides and i == 0)))
                radii.append(radius)
                owners.append(j if i == 0 else None)
                links.append(name)
        if not touching:
            raise InputError(f"finger '{finger}' of hand '{self.config.name}' has no geometry that can touch.")
        base = np.column_stack([frames[0][1], frames[0][0]])
        return {"base": base, "chain": np.stack(chain), "radii": np.array(radii), "joints": owners, "links": links}

    def _geometries(self, body: int) -> Iterator[int]:
        first = int(self.model.body_geomadr[body])
        for g in range(first, first + int(self.model.body_geomnum[body])):
            touches = self.model.geom_contype[g] or self.model.geom_conaffinity[g]
            if touches and max(self._half(g)[1]) > 0.0015:  # markers of a millimeter are no bodies
                yield g

    def _capsules(self, finger: str, k: int) -> Iterator[tuple[str, Array, Array, float]]:
        """Yield name, ends (3,) in the palm frame and radius of the capsules that joint k of a finger moves."""
        allowed = self.config.contact_links
        for name in allowed or []:
            if name not in self.body_ids:
                raise unknown_name("body", name, [known for known in self.body_ids if known])
        for body, owner in self.of_body.items():
            name = self.model.body(body).name
            if owner != (finger, k) or (allowed is not None and name not in allowed):
                continue
            for g in self._geometries(body):
                p, r = self._placed(self.data.geom_xpos[g], self.data.geom_xmat[g].reshape(3, 3))
                for near, far, radius in self._cover(g):
                    yield name, p + r @ near, p + r @ far, radius

    def _half(self, g: int) -> tuple[Array, Array]:
        """Return center and half extents (3,) of a geometry's box in its own frame."""
        return self.model.geom_aabb[g][:3].copy(), self.model.geom_aabb[g][3:].copy()

    def _cover(self, g: int) -> list[Capsule]:
        types = self.mujoco.mjtGeom
        kind, size = self.model.geom_type[g], self.model.geom_size[g]
        up = np.array([0.0, 0.0, 1.0])
        if kind == int(types.mjGEOM_SPHERE):
            return [(-0.5 * SHORTEST * up, 0.5 * SHORTEST * up, float(size[0]))]
        if kind == int(types.mjGEOM_CAPSULE):
            return [(-float(size[1]) * up, float(size[1]) * up, float(size[0]))]
        center, half = self._half(g)
        if kind != int(types.mjGEOM_MESH):
            return cover_box(center, half)
        mesh = int(self.model.geom_dataid[g])
        vertices = self.model.mesh_vert[self.model.mesh_vertadr[mesh] :][: self.model.mesh_vertnum[mesh]]
        faces = self.model.mesh_face[self.model.mesh_faceadr[mesh] :][: self.model.mesh_facenum[mesh]]
        return cover_mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces))

    def _palm_boxes(self) -> list[tuple[Array, Array, float]]:
        boxes = []
        types = self.mujoco.mjtGeom
        for body in self.of_palm:
            for g in self._geometries(body):
                center, half = self._half(g)
                p, r = self._placed(self.data.geom_xpos[g], self.data.geom_xmat[g].reshape(3, 3))
                smallest = float(half.min())
                round_body = self.model.geom_type[g] in (int(types.mjGEOM_SPHERE), int(types.mjGEOM_CAPSULE))
                rounding = smallest * (1.0 - 1e-6) if round_body else min(0.003, 0.5 * smallest)
                boxes.append((np.column_stack([r, p + r @ center]), half, rounding))
        return boxes

    def _preshape(
        self, name: str, config: PreshapeConfig, joints: tuple[str, ...], lower: Array, upper: Array
    ) -> Preshape:
        def values(given: Mapping[str, float], what: str, rest: Array) -> Array:
            for joint in given:
                if joint not in joints:
                    raise unknown_name(f"joint of {name}.{what}", joint, [known for known in joints if known])
                if joint in self.config.coupling:
                    raise InputError(
                        f"hand '{self.config.name}': '{joint}' follows '{self.config.coupling[joint].follows}'; "
                        f"take it out of {name}.{what}."
                    )
                low, high = lower.ravel()[joints.index(joint)], upper.ravel()[joints.index(joint)]
                if what != "posture" and not low - 1e-3 <= given[joint] <= high + 1e-3:
                    raise InputError(
                        f"hand '{self.config.name}': {name}.{what}.{joint} is {given[joint]:g}, outside its range "
                        f"{low:.4g} to {high:.4g} (radians or meters)."
                    )
            q = rest.copy().ravel()
            for i, joint in enumerate(joints):
                if joint in given:
                    q[i] = given[joint]
            for follower, coupling in self.config.coupling.items():
                for joint in (follower, coupling.follows):
                    if joint not in joints:
                        raise unknown_name("joint of coupling", joint, [known for known in joints if known])
                if coupling.follows in self.config.coupling:
                    raise InputError(
                        f"hand '{self.config.name}': '{follower}' follows '{coupling.follows}', which follows too; "
                        "name the joint that leads them all."
                    )
                offset = 0.0 if what == "posture" else coupling.offset
                q[joints.index(follower)] = coupling.factor * q[joints.index(coupling.follows)] + offset
            return q.reshape(lower.shape)

        rest = np.clip(0.0, lower, upper)
        opened = values(config.open, "open", rest)
        closed = values(config.closed, "closed", opened)
        if np.array_equal(opened, closed):
            raise InputError(
                f"preshape '{name}' of hand '{self.config.name}' does not close: open and closed are equal."
            )
        posture, limits = np.zeros_like(opened), (0.0, 0.0)
        if config.posture is not None:
            posture = values(config.posture.joints, "posture", np.zeros_like(opened))
            limits = (config.posture.range[0], config.posture.range[1])
        tries = np.round(np.linspace(*limits, _S1_TRIES + 2)[1:-1], 3).tolist() if limits[0] < limits[1] else [0.0]
        return Preshape(opened, (closed - opened) / CLOSED, posture, limits, limits, tuple(tries))
