"""A still picture of a grasp as PNG: drawn by MuJoCo where EGL or OSMesa is there, by matplotlib where neither is."""

import importlib
import io
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.reports.run_report import Scene, SceneMesh

__all__ = ["placed", "still_picture"]

_CONTEXTS: Final = ("mujoco.egl", "mujoco.osmesa")
_SEE_THROUGH: Final = 0.55
_FINEST: Final = 0.025  # longest edge that is painted in one go, in sizes of the scene: long ones lie before and behind


def still_picture(scene: Scene, width: int = 960, height: int = 720) -> tuple[bytes, str]:
    """Return the picture of a scene as PNG, and who drew it: "mujoco" or "matplotlib"."""
    for name in _CONTEXTS:
        try:
            pixels = _by_mujoco(scene, width, height, importlib.import_module(name))
        except Exception:  # whatever a graphics driver makes of it: there is another way
            continue
        return _png(pixels), "mujoco"
    return _by_matplotlib(scene, width, height), "matplotlib"


def placed(mesh: SceneMesh) -> NDArray[np.float64]:
    """Return the vertices (v, 3) of a mesh where it is at the end [m]."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if mesh.poses is None:
        return vertices
    pose = np.asarray(mesh.poses[-1], dtype=np.float64)
    return vertices @ pose[:, :3].T + pose[:, 3]


def _rgb(color: str) -> NDArray[np.float64]:
    return np.array([int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])


def _by_mujoco(scene: Scene, width: int, height: int, context: Any) -> NDArray[np.uint8]:
    mujoco: Any = importlib.import_module("mujoco")
    spec = mujoco.MjSpec()
    every = [placed(mesh) for mesh in scene.meshes]
    for i, (mesh, vertices) in enumerate(zip(scene.meshes, every, strict=True)):
        solid = spec.add_mesh(name=f"m{i}", uservert=vertices.ravel(), userface=np.asarray(mesh.faces).ravel())
        solid.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        alpha = _SEE_THROUGH if mesh.see_through else 1.0
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"m{i}", rgba=[*_rgb(mesh.color), alpha], contype=0, conaffinity=0
        )
    points = np.empty((0, 3)) if scene.contacts is None else np.asarray(scene.contacts.points)
    size = float(np.ptp(np.vstack(every), axis=0).max())
    for point in points:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.008 * size] * 3, pos=point, rgba=[0.91, 0.22, 0.31, 1.0]
        )
    spec.visual.map.znear, spec.visual.map.zfar = 0.01, 50.0
    spec.visual.headlight.ambient = [0.45] * 3
    spec.visual.headlight.diffuse = [0.55] * 3
    spec.visual.global_.fovy = 30.0
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    current = context.GLContext(width, height)
    try:
        current.make_current()
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
        shown = mujoco.MjvScene(model, maxgeom=len(scene.meshes) + len(points) + 10)
        camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, camera)
        lower, upper = np.vstack(every).min(axis=0), np.vstack(every).max(axis=0)
        eye = np.asarray(scene.view, dtype=np.float64)
        camera.lookat[:] = 0.5 * (lower + upper)
        camera.distance = 0.5 * float(np.linalg.norm(upper - lower)) / np.sin(np.radians(15.0))
        camera.azimuth = float(np.degrees(np.arctan2(-eye[1], -eye[0])))
        camera.elevation = -float(np.degrees(np.arctan2(eye[2], np.hypot(eye[0], eye[1]))))
        mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, shown)
        shown.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0
        shown.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_render(mujoco.MjrRect(0, 0, width, height), shown, drawing)
        mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, width, height), drawing)
        drawing.free()
    finally:
        current.free()
    pixels = pixels[::-1]
    background = np.all(pixels == 0, axis=2)
    return np.where(background[:, :, None], np.uint8(240), pixels)


def _png(pixels: NDArray[np.uint8]) -> bytes:
    from matplotlib.image import imsave

    content = io.BytesIO()
    imsave(content, np.ascontiguousarray(pixels), format="png")
    return content.getvalue()


def _divided(triangles: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    """Return triangles (k, 3, 3) that cover those given (t, 3, 3), none with an edge longer than `most`."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(
            np.roll(triangles, -1, axis=1) - triangles, axis=2
        )  # (t, 3), from each corner to the next
        long = edges.max(axis=1) > most
        done.append(triangles[~long])
        triangles, longest = triangles[long], edges[long].argmax(axis=1)
        a, b, c = (triangles[np.arange(len(triangles)), (longest + i) % 3] for i in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)


def _by_matplotlib(scene: Scene, width: int, height: int) -> bytes:
    """Draw all triangles from the farthest to the nearest, in parallel projection."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    back = np.asarray(scene.view, dtype=np.float64)
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right = right / np.linalg.norm(right)
    axes = np.column_stack([right, np.cross(back, right), back])  # to the right, up, and towards the eye
    lamp = np.array([0.3, 0.5, 1.0]) / np.linalg.norm([0.3, 0.5, 1.0])
    finest = _FINEST * float(np.ptp(np.vstack([placed(mesh) for mesh in scene.meshes]), axis=0).max())
    corners, colors = [], []
    for mesh in scene.meshes:
        triangles = _divided((placed(mesh) @ axes)[np.asarray(mesh.faces)], finest)
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-18)[:, None]
        seen = normals[:, 2] > 0.0
        light = 0.45 + 0.55 * np.maximum(normals[seen] @ lamp, 0.0)
        alpha = np.full(int(seen.sum()), _SEE_THROUGH if mesh.see_through else 1.0)
        corners.append(triangles[seen])
        colors.append(np.column_stack([light[:, None] * _rgb(mesh.color), alpha]))
    triangles, rgba = np.vstack(corners), np.vstack(colors)
    order = np.argsort(triangles[:, :, 2].mean(axis=1), kind="stable")
    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100, facecolor="#f0f0f0")
    FigureCanvasAgg(figure)
    plot = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    plot.set_axis_off()
    smooth = rgba[order][:, 3] < 1.0  # smooth edges leave seams between opaque triangles, hard ones double clear ones
    plot.add_collection(PolyCollection(list(triangles[order][:, :, :2]), facecolors=rgba[order], antialiaseds=smooth))
    if scene.contacts is not None and len(scene.contacts.points):
        points = np.asarray(scene.contacts.points) @ axes
        plot.scatter(points[:, 0], points[:, 1], s=14, c="#e8384f", zorder=3)
    lower, upper = triangles[:, :, :2].min(axis=(0, 1)), triangles[:, :, :2].max(axis=(0, 1))
    middle, half = 0.5 * (lower + upper), 0.55 * (upper - lower)
    half = np.maximum(half, [half[1] * width / height, half[0] * height / width])
    plot.set_xlim(middle[0] - half[0], middle[0] + half[0])
    plot.set_ylim(middle[1] - half[1], middle[1] + half[1])
    content = io.BytesIO()
    figure.savefig(content, format="png", metadata={"Software": None})
    return content.getvalue()
