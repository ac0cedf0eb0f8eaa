"""Splits polygons into triangles: convex and concave, planar or nearly so."""

from __future__ import annotations

import numpy as np

MAX_CLIPPED_CORNERS = 2000
"""Concave polygons with more corners are fanned: ear clipping takes the square of the number."""


def triangulate(points: np.ndarray, starts: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangulates many polygons.

    Args:
        points: (C, 3) float64 corner positions, polygon after polygon.
        starts: (P,) first corner of each polygon.
        sizes: (P,) number of its corners, at least 3.

    Returns:
        (T, 3) corner indices in the polygons' orientation, and (T,) the polygon of each triangle, ascending.
    """
    parts, owners = [], []
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        corners = starts[chosen, None] + np.arange(size)
        if size == 3:
            triangles = corners[:, None, :]
        elif size == 4:
            triangles = _split_quads(points, corners)
        else:
            triangles = np.stack([_split_polygon(points, ring) for ring in corners])
        parts.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(chosen, size - 2))
    if not parts:
        return np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(parts)[order], owner[order]


def _split_quads(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Splits quadrilaterals (Q, 4) along the diagonal that lies inside, (Q, 2, 3)."""
    a, b, c, d = (points[corners[:, k]] for k in range(4))
    first = np.cross(b - a, c - a)
    second = np.cross(c - a, d - a)
    fine = np.einsum("qi,qi->q", first, second) >= 0.0
    along_ac = corners[:, [[0, 1, 2], [0, 2, 3]]]
    along_bd = corners[:, [[0, 1, 3], [1, 2, 3]]]
    return np.where(fine[:, None, None], along_ac, along_bd)


def _split_polygon(points: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Triangles of one polygon with corner indices `ring` (N,), (N - 2, 3)."""
    corners = points[ring]
    following = np.roll(corners, -1, axis=0)
    normal = np.cross(corners - corners[0], following - corners[0]).sum(axis=0)  # twice the vector area
    turns = np.cross(following - corners, np.roll(corners, -2, axis=0) - following) @ normal
    fan = np.stack([np.broadcast_to(ring[0], len(ring) - 2), ring[1:-1], ring[2:]], axis=1)
    if not np.any(turns < 0.0) or len(ring) > MAX_CLIPPED_CORNERS:
        return fan
    # Drop the axis along which the polygon is seen best, keeping its orientation.
    axis = int(np.argmax(np.abs(normal)))
    flat = corners[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if normal[axis] < 0.0:
        flat = flat[:, ::-1]
    return ring[_clip_ears(flat)]


def _clip_ears(flat: np.ndarray) -> np.ndarray:
    """Ear clipping of a counter-clockwise polygon (N, 2); gives up gracefully on one that intersects itself."""
    rest = list(range(len(flat)))
    triangles = []
    at = 0
    failures = 0
    while len(rest) > 3:
        count = len(rest)
        before, here, after = rest[at - 1], rest[at], rest[(at + 1) % count]
        forced = failures >= count
        if forced or _is_ear(flat, before, here, after, rest):
            triangles.append((before, here, after))
            del rest[at]
            at = (at - 1) % len(rest) if at else 0
            failures = 0
        else:
            at = (at + 1) % count
            failures += 1
        at %= len(rest)
    triangles.append(tuple(rest))
    return np.array(triangles)


def _is_ear(flat: np.ndarray, before: int, here: int, after: int, rest: list[int]) -> bool:
    """Whether a corner points outwards and its triangle holds no other corner."""
    a, b, c = flat[before], flat[here], flat[after]
    if _turn(a, b, c) <= 0.0:
        return False
    others = flat[[k for k in rest if k not in (before, here, after)]]
    inside = (_turn(a, b, others) >= 0.0) & (_turn(b, c, others) >= 0.0) & (_turn(c, a, others) >= 0.0)
    # A corner that coincides with one of the triangle's (a hole cut open) does not block it.
    same = np.zeros(len(others), dtype=bool)
    for corner in (a, b, c):
        same |= np.all(others == corner, axis=1)
    return not np.any(inside & ~same)


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of the triangles a b c; positive when counter-clockwise. `c` may be (N, 2)."""
    return (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
