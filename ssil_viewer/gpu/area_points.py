"""Points on area lights from which their shadows are drawn, and the views that see all that a point lights."""

from __future__ import annotations

import math

import numpy as np

from ssil_viewer.scene.model import Light

TILES_PER_POINT = 3
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
# Off the surface by this share of its size, so that a lamp's own geometry does not lie before the light
_OFFSET = 1e-3


def area_frame(light: Light) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (u, v, direction) of a light: along a rectangle's width, its height, and its emission.

    They are right-handed as u x v = direction: seen from the lit side, u points to the right and v up.
    """
    direction = _unit(np.asarray(light.direction, np.float64), np.array((0.0, -1.0, 0.0)))
    up = np.asarray(light.up, np.float64)
    u = np.cross(up, direction)
    if np.linalg.norm(u) < 1e-6 * max(float(np.linalg.norm(up)), 1e-30):    # up says nothing here
        u = np.cross((1.0, 0.0, 0.0) if abs(direction[0]) < 0.9 else (0.0, 0.0, 1.0), direction)
    u = _unit(u, np.array((1.0, 0.0, 0.0)))
    return u, np.cross(direction, u), direction


def area_size(light: Light) -> float:
    """Area of the emitting surface, square metres."""
    if light.kind == "rectangle":
        return light.width * light.height
    return (math.pi if light.kind == "disc" else 4.0 * math.pi) * light.radius**2


def area_points(light: Light, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points that stand for equal parts of an area.

    A lattice in which no two points share a row or a column: the shadow of an edge parallel to a side has as many
    steps as there are points, not their square root.

    Returns:
        (N, 3) positions relative to the light's, and (N, 3) unit normals of the side that emits.
    """
    u, v, direction = area_frame(light)
    golden = (np.arange(count) * _GOLDEN + 0.5) % 1.0
    # Even steps along both sides, the second in the golden sequence's order
    square = (np.stack([np.arange(count), np.argsort(np.argsort(golden))], axis=1) + 0.5) / count
    if light.kind == "sphere":
        turn, height = 2.0 * np.pi * golden, 1.0 - 2.0 * square[:, 0]
        flat = np.sqrt(1.0 - height**2)
        normals = np.stack([flat * np.cos(turn), height, flat * np.sin(turn)], axis=1)
        return normals * light.radius * (1.0 + _OFFSET), normals
    if light.kind == "disc":
        places = light.radius * _disc_from_square(square)
    else:
        places = (square - 0.5) * (light.width, light.height)
    offset = _OFFSET * math.sqrt(area_size(light))
    return places @ np.stack([u, v]) + direction * offset, np.tile(direction, (count, 1))


def point_count(light: Light, samples: int) -> int:
    """Points that a light has: on a sphere twice as many, since a receiver faces half of them."""
    return samples * (2 if light.kind == "sphere" else 1)


def point_spacing(light: Light, count: int) -> float:
    """Distance between the steps of the shadow that such points cast, seen on the light; metres."""
    if light.kind == "sphere":
        return math.sqrt(math.pi) * light.radius / (count / 2)
    return math.sqrt(area_size(light)) / count


def hemisphere_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three axes at right angles, tilted alike off the normal: (3) unit vectors.

    Every direction d of the hemisphere about the normal has one of them, the one with the largest component of d, for
    which the other two components lie between -2 and 1 times that component: since the three sum to more than 0.
    """
    a = np.cross(normal, (1.0, 0.0, 0.0) if abs(normal[0]) < 0.9 else (0.0, 0.0, 1.0))
    a /= np.linalg.norm(a)
    b = np.cross(normal, a)
    axes = []
    for turn in (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0):
        flat = np.cos(turn) * a + np.sin(turn) * b
        axes.append(normal / np.sqrt(3.0) + flat * np.sqrt(2.0 / 3.0))
    return axes[0], axes[1], axes[2]


def _disc_from_square(square: np.ndarray) -> np.ndarray:
    """(N, 2) in the unit square to the unit disc, equal areas to equal areas (Shirley and Chiu 1997)."""
    x, y = (2.0 * square - 1.0).T
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    safe = np.where(radius == 0.0, 1.0, radius)
    turn = np.where(wide, y / safe * np.pi / 4, np.pi / 2 - x / safe * np.pi / 4)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


def _unit(vector: np.ndarray, fallback: np.ndarray) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else fallback
