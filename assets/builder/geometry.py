"""Triangle surfaces as numpy arrays, and the primitives the scenes are built from.

All surfaces are right-handed, +Y up, metres, with counter-clockwise front faces and outward unit normals.
Texture coordinates are kept in *metres along the surface* (v grows downwards, glTF's origin is the top
left); `scene.SceneBuilder` divides them by the size of a material's texture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CREASE_COSINE = np.cos(np.radians(35.0))
"""Neighbouring profile edges that turn more than this get a hard edge between them."""


@dataclass(frozen=True, eq=False)
class Surface:
    """An indexed triangle surface.

    Attributes:
        positions: (V, 3) float64, metres.
        normals: (V, 3) float64, unit, outward.
        uvs: (V, 2) float64, metres along the surface, or [0, 1] where a maker says so.
        triangles: (T, 3) int64.
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    triangles: np.ndarray

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Surface:
        """The surface translated, metres; texture coordinates move with it."""
        return Surface(self.positions + np.array([x, y, z]), self.normals, self.uvs, self.triangles)

    def turned(self, axis: str, degrees: float) -> Surface:
        """The surface rotated about a coordinate axis through the origin, counter-clockwise."""
        matrix = rotation(axis, degrees)
        return Surface(self.positions @ matrix.T, self.normals @ matrix.T, self.uvs, self.triangles)

    def scaled(self, x: float, y: float, z: float) -> Surface:
        """The surface scaled by positive factors per axis; texture coordinates stay."""
        factor = np.array([x, y, z])
        return Surface(self.positions * factor, unit(self.normals / factor), self.uvs, self.triangles)

    def with_uvs(self, uvs: np.ndarray) -> Surface:
        """The surface with other texture coordinates, (V, 2)."""
        return Surface(self.positions, self.normals, np.asarray(uvs, dtype=np.float64), self.triangles)


def rotation(axis: str, degrees: float) -> np.ndarray:
    """The (3, 3) rotation about "x", "y" or "z", counter-clockwise seen from the axis' tip."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors along the last axis, scaled to length 1; zero vectors become +Y."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), np.array([0.0, 1.0, 0.0]))


def merge(*surfaces: Surface) -> Surface:
    """One surface that holds the triangles of all."""
    starts = np.cumsum([0] + [len(s.positions) for s in surfaces])
    return Surface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate([s.normals for s in surfaces]),
        np.concatenate([s.uvs for s in surfaces]),
        np.concatenate([s.triangles + start for s, start in zip(surfaces, starts)]),
    )


def grid(points: np.ndarray, uvs: np.ndarray, wrap_rows: bool = False, wrap_columns: bool = False) -> Surface:
    """A smooth surface through a grid of points.

    The front is where `cross(d/d column, d/d row)` points: with columns to the right and rows upwards it
    faces the viewer.

    Args:
        points: (R, C, 3), metres.
        uvs: (R, C, 2).
        wrap_rows, wrap_columns: The first and last row (column) are the same points, so that normals are
            shared across the seam while texture coordinates differ.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)
    flat = points.reshape(-1, 3)
    triangles = _without_slivers(flat, triangles)
    face = np.cross(flat[triangles[:, 1]] - flat[triangles[:, 0]], flat[triangles[:, 2]] - flat[triangles[:, 0]])
    normals = np.zeros_like(flat)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], face)
    shaped = normals.reshape(rows, columns, 3)
    if wrap_rows:
        shaped[0] = shaped[-1] = shaped[0] + shaped[-1]
    if wrap_columns:
        shaped[:, 0] = shaped[:, -1] = shaped[:, 0] + shaped[:, -1]
    for row in (0, rows - 1):
        # A row that is one point (the pole of a lathe) has one normal.
        if np.ptp(points[row], axis=0).max() < 1e-9:
            shaped[row] = shaped[row].sum(axis=0)
    return Surface(flat.copy(), unit(normals), np.asarray(uvs, dtype=np.float64).reshape(-1, 2), triangles)


def _without_slivers(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-10]


def polygon_face(points: np.ndarray, normal: Sequence[float], uvs: np.ndarray | None = None) -> Surface:
    """A flat simple polygon.

    Args:
        points: (N, 3) in one plane, counter-clockwise seen from the tip of `normal`.
        normal: Unit vector.
        uvs: (N, 2), or None for metres in the plane.
    """
    points = np.asarray(points, dtype=np.float64)
    axis = np.asarray(normal, dtype=np.float64)
    right = unit(np.cross([0.0, 1.0, 0.0], axis)) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    up = np.cross(axis, right)
    plane = np.stack([points @ right, points @ up], axis=-1)
    if uvs is None:
        uvs = plane * [1.0, -1.0]
    return Surface(points, np.tile(axis, (len(points), 1)), np.asarray(uvs, dtype=np.float64), _triangulate(plane))


def _triangulate(polygon: np.ndarray) -> np.ndarray:
    """Ear clipping of a simple counter-clockwise polygon, (N, 2) -> (N - 2, 3)."""

    def cross(o: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
        return float((a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]))

    left = list(range(len(polygon)))
    triangles = []
    while len(left) > 3:
        for k in range(len(left)):
            corner = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = polygon[list(corner)]
            if cross(a, b, c) <= 1e-12:
                continue
            others = (polygon[m] for m in left if m not in corner)
            if any(min(cross(a, b, p), cross(b, c, p), cross(c, a, p)) > -1e-12 for p in others):
                continue
            triangles.append(corner)
            del left[k]
            break
        else:
            # Only collinear corners are left; they span no area.
            left.pop()
    triangles.append(tuple(left))
    return np.array(triangles)


def box(low: Sequence[float], high: Sequence[float], skip: str = "") -> Surface:
    """An axis-aligned box whose texture coordinates are the object's coordinates, so that neighbours line up.

    Args:
        low, high: Opposite corners, metres.
        skip: Faces to leave out, for instance "-y" or "-y+y": only for those nobody can ever see.
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    pick = {
        "+x": ((1, 0, 1), (1, 0, 0), (1, 1, 0), (1, 1, 1)),
        "-x": ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)),
        "+y": ((0, 1, 1), (1, 1, 1), (1, 1, 0), (0, 1, 0)),
        "-y": ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
        "+z": ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        "-z": ((1, 0, 0), (0, 0, 0), (0, 1, 0), (1, 1, 0)),
    }
    normal = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}
    skipped = {skip[i : i + 2] for i in range(0, len(skip), 2)}
    faces = []
    for name, corners in pick.items():
        if name not in skipped:
            faces.append(polygon_face(low + (high - low) * np.array(corners, dtype=np.float64), normal[name]))
    return merge(*faces)


def profile_runs(profile: np.ndarray, closed: bool) -> list[np.ndarray]:
    """Splits a polyline at its hard edges.

    Args:
        profile: (P, 2). A closed one does not repeat its first point.

    Returns:
        Polylines that overlap in their end points; each is to be shaded smoothly.
    """
    points = np.asarray(profile, dtype=np.float64)
    if closed:
        points = np.concatenate([points, points[:1]])
    edges = np.diff(points, axis=0)
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    hard = [i for i in range(1, len(edges)) if edges[i - 1] @ edges[i] < CREASE_COSINE]
    if closed and not hard:
        return [points]
    cuts = [0, *hard, len(points) - 1]
    return [points[a : b + 1] for a, b in zip(cuts[:-1], cuts[1:])]


def lathe(profile: Sequence[tuple[float, float]], segments: int, cap: bool = True) -> Surface:
    """A surface of revolution about +Y.

    Args:
        profile: (radius, height) from bottom to top along the outside, metres; overhangs are allowed.
        segments: Sides of the circle.
        cap: Close ends that do not reach the axis with discs.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    parts = []
    points = np.asarray(profile, dtype=np.float64)
    travelled = 0.0
    mean_radius = max(float(points[:, 0].mean()), 0.05)
    for run in profile_runs(points, closed=False):
        # The seam must close to the last bit, or normals and depth show a hairline.
        cosine, sine = np.cos(angle), np.sin(angle)
        cosine[-1], sine[-1] = cosine[0], sine[0]
        height = np.repeat(run[:, 1:], len(angle), axis=1)
        shell = np.stack([run[:, :1] * sine, height, run[:, :1] * cosine], axis=-1)
        length = travelled + np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
        travelled = float(length[-1])
        uvs = np.stack(np.broadcast_arrays(angle[None, :] * mean_radius, -length[:, None]), axis=-1)
        parts.append(grid(shell, uvs, wrap_columns=True))
    if cap:
        bottom, top = parts[0].positions[:segments], parts[-1].positions[-segments - 1 : -1]
        for end, sign, ring in ((0, -1.0, bottom[::-1]), (-1, 1.0, top)):
            if points[end, 0] > 1e-6:
                centre = ring.mean(axis=0, keepdims=True)
                disc = np.concatenate([ring, centre])
                index = np.arange(segments)
                fan = np.stack([index, (index + 1) % segments, np.full(segments, segments)], axis=-1)
                normal = np.tile([0.0, sign, 0.0], (len(disc), 1))
                parts.append(Surface(disc, normal, disc[:, [0, 2]].copy(), fan))
    return merge(*parts)


def sweep(
    profile: Sequence[tuple[float, float]],
    origins: np.ndarray,
    axes_a: np.ndarray,
    axes_b: np.ndarray,
    loop: bool = False,
    smooth: bool = True,
) -> Surface:
    """A closed profile carried along a path; a solid with end caps, or a ring.

    Args:
        profile: (P, 2) closed polygon in (a, b), metres, counter-clockwise when the path comes towards the
            viewer with `a` to the right and `b` up.
        origins, axes_a, axes_b: (N, 3) each: frames along the path; `cross(a, b)` points along the path.
            The axes may be longer than 1 (mitred corners).
        loop: The path returns to its first frame, which is not repeated.
        smooth: Shade smoothly along the path (arcs) rather than in flat stretches (straight runs).
    """
    polygon = np.asarray(profile, dtype=np.float64)
    frames = [np.asarray(v, dtype=np.float64) for v in (origins, axes_a, axes_b)]
    if loop:
        frames = [np.concatenate([v, v[:1]]) for v in frames]
    origins, axes_a, axes_b = frames
    steps = np.linalg.norm(np.diff(origins, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    parts = []
    around = 0.0
    for run in profile_runs(polygon, closed=True):
        across = around + np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
        around = float(across[-1])
        ring = origins[None] + run[:, None, :1] * axes_a[None] + run[:, None, 1:] * axes_b[None]
        uvs = np.stack(np.broadcast_arrays(along[None, :], across[:, None]), axis=-1)
        # Rows run along the profile and columns along the path, which looks inwards: swap for outwards.
        ring, uvs = ring.transpose(1, 0, 2), uvs.transpose(1, 0, 2)
        if smooth:
            closed_run = bool(np.allclose(run[0], run[-1]))
            parts.append(grid(ring, uvs, wrap_rows=loop, wrap_columns=closed_run))
        else:
            parts.extend(grid(ring[i : i + 2], uvs[i : i + 2]) for i in range(len(ring) - 1))
    if not loop:
        for i, sign in ((0, -1.0), (-1, 1.0)):
            face = origins[i] + polygon[:, :1] * axes_a[i] + polygon[:, 1:] * axes_b[i]
            normal = sign * unit(np.cross(axes_a[i], axes_b[i]))
            parts.append(polygon_face(face if sign > 0 else face[::-1], normal))
    return merge(*parts)


def extrude(profile: Sequence[tuple[float, float]], depth: float) -> Surface:
    """A prism: a polygon in x, y (counter-clockwise) from z = 0 to z = depth, metres."""
    origins = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, depth]])
    return sweep(profile, origins, np.tile([1.0, 0, 0], (2, 1)), np.tile([0, 1.0, 0], (2, 1)), smooth=False)


def sphere(radius: float, rings: int = 24, segments: int = 48) -> Surface:
    """A sphere about the origin; texture coordinates are longitude and latitude in metres."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = np.stack([np.maximum(radius * np.cos(angle), 0.0), radius * np.sin(angle)], axis=-1)
    profile[[0, -1], 0] = 0.0
    return lathe([tuple(p) for p in profile], segments)


def torus(major: float, minor: float, rings: int = 24, segments: int = 64) -> Surface:
    """A torus about +Y through the origin, metres."""
    angle = np.linspace(0.0, 2 * np.pi, rings, endpoint=False)
    profile = np.stack([minor * np.cos(angle), minor * np.sin(angle)], axis=-1)
    turn = np.linspace(0.0, 2 * np.pi, segments, endpoint=False)
    out = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], axis=-1)
    up = np.tile([0.0, 1.0, 0.0], (segments, 1))
    # The path turns clockwise about +Y so that cross(out, up) points along it.
    return sweep([tuple(p) for p in profile], major * out[::-1], out[::-1], up, loop=True)


def tangents(surface: Surface) -> np.ndarray:
    """Tangents for normal maps.

    Returns:
        (V, 4): unit xyz along growing u, orthogonal to the normal, and w = +1 or -1 so that
        w * cross(normal, tangent) points up in the image (falling v), as glTF has it.
    """
    p, uv, t = surface.positions, surface.uvs, surface.triangles
    e1, e2 = p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]
    d1, d2 = uv[t[:, 1]] - uv[t[:, 0]], uv[t[:, 2]] - uv[t[:, 0]]
    det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    safe = np.where(np.abs(det) > 1e-14, det, 1.0)[:, None]
    weight = np.linalg.norm(np.cross(e1, e2), axis=1, keepdims=True) * (np.abs(det) > 1e-14)[:, None]
    du = weight * unit((e1 * d2[:, 1:] - e2 * d1[:, 1:]) / safe)
    dv = weight * unit((e2 * d1[:, :1] - e1 * d2[:, :1]) / safe)
    sum_u, sum_v = np.zeros_like(p), np.zeros_like(p)
    for corner in range(3):
        np.add.at(sum_u, t[:, corner], du)
        np.add.at(sum_v, t[:, corner], dv)
    n = surface.normals
    tangent = sum_u - n * np.sum(n * sum_u, axis=1, keepdims=True)
    spare = np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 0, 1.0]])
    spare = spare - n * np.sum(n * spare, axis=1, keepdims=True)
    tangent = np.where(np.linalg.norm(tangent, axis=1, keepdims=True) > 1e-9, tangent, spare)
    tangent = unit(tangent)
    handed = np.where(np.sum(np.cross(n, tangent) * -sum_v, axis=1) < 0.0, -1.0, 1.0)
    return np.concatenate([tangent, handed[:, None]], axis=1)
