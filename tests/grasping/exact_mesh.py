"""The exact mesh distances of coal, a library that shares nothing with ours."""

import coal
import numpy as np


class ExactMesh:
    def __init__(self, obj):
        self.mesh = coal.BVHModelOBBRSS()
        self.mesh.beginModel(len(obj.faces), len(obj.vertices))
        self.mesh.addVertices(obj.vertices)
        self.mesh.addTriangles(obj.faces.astype(np.int64))
        self.mesh.endModel()

    def capsule(self, near, far, radius):
        return self._distance(*capsule(near, far, radius))

    def box(self, pose, half_extents, rounding):
        """Distance of a box with round edges: the box without them, less their radius."""
        core = coal.Box(*(2.0 * (half_extents - rounding)))
        return self._distance(core, coal.Transform3s(pose[:, :3], pose[:, 3])) - rounding

    @staticmethod
    def between(shape, transform, near, far, radius):
        """Distance of any shape to a capsule."""
        return coal.distance(shape, transform, *capsule(near, far, radius), coal.DistanceRequest(), result())

    def _distance(self, shape, transform):
        return coal.distance(shape, transform, self.mesh, coal.Transform3s(), coal.DistanceRequest(), result())


def result():
    return coal.DistanceResult()


def capsule(near, far, radius):
    length = np.linalg.norm(far - near)
    z = (far - near) / length
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    return coal.Capsule(radius, length), coal.Transform3s(rotation, 0.5 * (near + far))


def capsule_pair(a, b, radius):
    """Distance between two capsules with ends (2, 3)."""
    first, second = capsule(a[0], a[1], radius), capsule(b[0], b[1], radius)
    return coal.distance(*first, *second, coal.DistanceRequest(), result())
