"""Chooses the first view of a scene."""

from __future__ import annotations

import math

import numpy as np

from ssil_viewer.scene.model import Camera, Scene

VERTICAL_FOV = math.radians(50.0)

_ASPECT = 1.5
"""Width to height for which everything fits: a little less than the usual 16:9 window."""

_MARGIN = 1.08
"""Space left around what is framed."""

_THREE_QUARTER = np.array([0.55, 0.4, 0.75])
"""From the scene to the eye: right of, above and before it."""

_ENCLOSED = -0.15
"""Winding number below which the middle counts as inside a room. A closed cube seen from within has -1, one without
front -5/6; a courtyard full of columns, whose backs count against its walls, -0.26 (Crytek Sponza)."""

_OPENING = 0.05
"""Share of the surface that is missing at a side, from which on a room counts as open there."""

_SHEET = 0.6
"""The same share, from which on there is rather a sheet than a body, to be seen from its front."""

_MAX_INSTANCES, _MAX_TRIANGLES = 2_000, 400_000
"""Larger scenes are judged by a sample of them, to take no more than a fraction of a second."""


def default_camera(scene: Scene) -> Camera:
    """The scene's first camera, or else a view that shows it.

    Objects are framed from three quarters. A room, whose faces look inwards, is seen through its open side
    when it has one, and from within otherwise.
    """
    if scene.cameras:
        return scene.cameras[0]
    low, high = scene.bounds()
    center = (low + high) / 2.0
    winding, opening = _enclosure(scene, center)
    if winding < _ENCLOSED:
        sideways = np.linalg.norm(opening[[0, 2]])
        if sideways > _OPENING and sideways > abs(opening[1]):
            return _framed(low, high, opening * (1.0, 0.0, 1.0))
        if np.linalg.norm(opening) < _SHEET:
            return _inside(low, high)
    share = np.linalg.norm(opening)
    towards_eye = opening / share + 0.5 * _THREE_QUARTER if share > _SHEET else _THREE_QUARTER
    return _framed(low, high, towards_eye)


def _framed(low: np.ndarray, high: np.ndarray, towards_eye: np.ndarray) -> Camera:
    """The view of a box from a direction, as near as the box fits into the picture."""
    center = (low + high) / 2.0
    size = float((high - low).max())
    if not size > 0.0:
        size = max(1.0, float(np.abs(center).max())) * 1e-3
    back = towards_eye / np.linalg.norm(towards_eye)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    corners = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)]) * (high - low) + low - center
    x, y, z = axes @ corners.T
    slope = math.tan(VERTICAL_FOV / 2.0)
    distance = float(np.max(z + np.maximum(np.abs(x) / (slope * _ASPECT), np.abs(y) / slope))) * _MARGIN
    eye = center + back * max(distance, 0.6 * size)
    return Camera("framed", tuple(eye.tolist()), tuple(center.tolist()), vertical_fov=VERTICAL_FOV)


def _inside(low: np.ndarray, high: np.ndarray) -> Camera:
    """A view along the longer side of a room, from near its end, at a third of its height."""
    size = high - low
    along = 0 if size[0] >= size[2] else 2
    eye, target = (low + high) / 2.0, (low + high) / 2.0
    eye[1] = target[1] = low[1] + size[1] / 3.0
    eye[along] -= 0.25 * size[along]
    target[along] += 0.1 * size[along]
    return Camera("inside", tuple(eye.tolist()), tuple(target.tolist()), vertical_fov=VERTICAL_FOV)


def _enclosure(scene: Scene, point: np.ndarray) -> tuple[float, np.ndarray]:
    """How a point is enclosed by the front sides of the surfaces.

    Source: van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle"; Jacobson et al. 2013, "Robust
        Inside-Outside Segmentation using Generalized Winding Numbers".

    Args:
        scene: The scene.
        point: (3,) world space.

    Returns:
        The generalized winding number: -1 in a closed room, whose faces look at the point, +1 within a solid
        body, 0 outside; and the (3,) sum of the area vectors over the whole area, which points out of the opening
        of a room.
    """
    solid_angle = 0.0
    area_vector = np.zeros(3)
    area = 0.0
    step = 1 + len(scene.instances) // _MAX_INSTANCES
    triangle_step = 1 + scene.triangle_count // _MAX_TRIANGLES
    for instance in scene.instances[::step]:
        linear = instance.world_from_object[:3, :3]
        mirrored = np.linalg.det(linear) < 0.0
        for primitive in scene.meshes[instance.mesh].primitives:
            # One row for each axis, (3, T): numpy is several times as fast with long rows
            world = linear @ primitive.positions.T + (instance.world_from_object[:3, 3] - point)[:, None]
            a, b, c = (np.take(world, primitive.indices[::triangle_step, corner], axis=1) for corner in range(3))
            if mirrored:
                b, c = c, b
            cross = _cross(b - a, c - a)
            area_vector += cross.sum(axis=1)
            area += float(_length(cross).sum())
            la, lb, lc = _length(a), _length(b), _length(c)
            ab, bc, ca = _dot(a, b), _dot(b, c), _dot(c, a)
            volume = _dot(a, _cross(b, c))
            solid_angle += 2.0 * float(np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum())
    return solid_angle * step * triangle_step / (4.0 * math.pi), area_vector / max(area, 1e-300)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Dot products of the columns of two (3, N) arrays."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of the columns of two (3, N) arrays."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _length(a: np.ndarray) -> np.ndarray:
    """Lengths of the columns of a (3, N) array."""
    return np.sqrt(_dot(a, a))
