"""The relief at the far end of the atrium: a lion's mask in a round frame, sculpted as a height field.

It hangs where the sun never reaches: what is seen of it is seen by indirect light.
"""

from __future__ import annotations

import numpy as np

from .geometry import Surface, grid, merge, polygon_face
from .textures import noise, smoothstep

SIZE = 2.1
"""Side of the square panel, metres."""
MESH = 88
"""Cells of the mesh along a side; what is finer goes into the normal map."""
DETAIL = 512
"""Texels of the normal map along a side."""


def height(count: int) -> np.ndarray:
    """The sculpture's height.

    Returns:
        (count, count) metres above the panel's ground; row 0 = top, samples from edge to edge.
    """
    at = np.linspace(-1.0, 1.0, count)
    x, y = np.meshgrid(at, -at)
    side = np.abs(x)
    mane = _mane(x, y) * smoothstep(0.86, 1.02, np.hypot(x / 0.43, (y + 0.04) / 0.64))
    face = _dome(x, y, 0.0, 0.0, 0.47, 0.56, 0.20)
    face = _blend(face, _dome(side, y, 0.27, -0.12, 0.22, 0.26, 0.24), 0.05)  # cheeks
    face = _blend(face, _dome(x, y, 0.0, 0.34, 0.36, 0.24, 0.24), 0.05)  # forehead
    face -= 0.035 * np.exp(-((x / 0.035) ** 2)) * smoothstep(0.18, 0.28, y) * smoothstep(0.5, 0.4, y)
    brow_line = 0.235 + 0.10 * np.sin(np.clip((side - 0.04) / 0.36, 0, 1) * np.pi * 0.8) - 0.12 * side
    brow = 0.075 * np.exp(-(((y - brow_line) / 0.055) ** 2))
    face += brow * smoothstep(0.42, 0.30, side) * smoothstep(0.02, 0.09, side)
    face -= 0.095 * np.exp(-(((side - 0.195) / 0.115) ** 2) - ((y - 0.115) / 0.075) ** 2)  # sockets
    bridge = 0.30 - 0.10 * smoothstep(-0.1, 0.32, y)
    nose_width = 0.055 + 0.045 * smoothstep(0.15, -0.18, y)
    nose = bridge * smoothstep(nose_width + 0.06, nose_width - 0.03, side)
    nose *= smoothstep(0.42, 0.2, y) * smoothstep(-0.235, -0.19, y)
    face = _blend(face, nose, 0.03)
    face = _blend(face, _dome(side, y, 0.115, -0.285, 0.165, 0.135, 0.335), 0.03)  # muzzle
    face -= 0.05 * np.exp(-((x / 0.016) ** 2)) * smoothstep(-0.2, -0.24, y) * smoothstep(-0.42, -0.36, y)
    tip = smoothstep(0.012, -0.022, side - 0.105 - 0.65 * np.minimum(y + 0.15, 0.0))
    face = np.maximum(face, 0.355 * tip * smoothstep(-0.27, -0.245, y) * smoothstep(-0.09, -0.15, y))
    face -= 0.05 * np.exp(-(((side - 0.055) / 0.024) ** 2) - ((y + 0.205) / 0.018) ** 2)  # nostrils
    jaw = _dome(x, y, 0.0, -0.50, 0.20, 0.15, 0.25)
    face = _blend(face, jaw, 0.03)
    mouth = smoothstep(1.15, 0.85, np.hypot(x / 0.165, (y + 0.425 - 0.9 * x * x) / 0.055))
    face -= 0.16 * mouth
    fangs = smoothstep(0.030, 0.018, np.abs(side - 0.105) + 0.35 * np.abs(y + 0.415)) * 0.10
    face += fangs * mouth
    eye_y = (y - 0.115 - 0.12 * (side - 0.195)) / 0.047
    eye = np.hypot((side - 0.195) / 0.088, eye_y)
    face = np.maximum(face, 0.20 * np.sqrt(np.clip(1.0 - 0.62 * eye**2, 0.0, 1.0)) * (eye < 1.05))
    face += 0.022 * np.exp(-(((eye - 1.12) / 0.16) ** 2))  # lids
    face -= 0.022 * smoothstep(0.034, 0.020, np.hypot(side - 0.195, y - 0.118))  # pupils
    whisker = np.sin((y + 0.285) * 130.0 + side * 20.0)
    pads = smoothstep(0.05, 0.11, side) * smoothstep(0.24, 0.19, side) * smoothstep(0.11, 0.06, np.abs(y + 0.285))
    face -= 0.004 * whisker * pads
    fade = smoothstep(1.05, 0.80, np.hypot(x / 0.46, (y + 0.03) / 0.60))
    hollow = np.exp(-(((side - 0.40) / 0.06) ** 2) - ((y - 0.46) / 0.07) ** 2)
    ear = _dome(side, y, 0.40, 0.47, 0.14, 0.15, 0.30) - 0.10 * hollow
    head = np.maximum(_blend(mane, face * fade + 0.06 * fade, 0.02), ear)
    r = np.hypot(x, y)
    ring = 0.11 * np.sqrt(np.clip(1.0 - ((r - 0.925) / 0.055) ** 2, 0.0, 1.0))
    beads = np.hypot(((np.arctan2(y, x) / (2 * np.pi) * 60.0) % 1.0 - 0.5) * 2 * np.pi * 0.84 / 60.0, r - 0.84)
    ring = np.maximum(ring, 0.05 * np.sqrt(np.clip(1.0 - (beads / 0.030) ** 2, 0.0, 1.0)))
    corner = np.hypot(side - 0.84, np.abs(y) - 0.84)
    petals = 0.10 + 0.022 * np.cos(6.0 * np.arctan2(np.abs(y) - 0.84, side - 0.84))
    rosette = 0.06 * np.sqrt(np.clip(1.0 - (corner / petals) ** 2, 0.0, 1.0))
    rosette *= 0.6 + 0.4 * smoothstep(0.02, 0.05, corner)
    return np.maximum(np.maximum(head, ring), rosette)


def _mane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Three rings of flame-like locks, the inner ones over the outer ones."""
    r, angle = np.hypot(x, y * 0.97), np.arctan2(x, y)
    result = np.zeros_like(r)
    for count, start, end, top, phase, swirl in (
        (22, 0.50, 0.815, 0.12, 0.0, 0.55),
        (18, 0.42, 0.70, 0.185, 0.5, -0.50),
        (14, 0.34, 0.585, 0.235, 0.2, 0.45),
    ):
        s = (r - start) / (end - start)
        # Locks bend alternately; each is widest in its middle and ends in a point.
        turn = (angle / (2 * np.pi) * count + phase + swirl * np.clip(s, 0, 1) ** 2) % 1.0
        across = np.abs(turn - 0.5) * 2.0
        width = np.sqrt(np.clip(1.0 - np.clip(s, 0.0, 1.0) ** 2.2, 0.0, 1.0))
        body = np.sqrt(np.clip(1.0 - (across / np.maximum(width, 1e-3)) ** 2, 0.0, 1.0)) * (s < 1.0)
        strands = 1.0 + 0.10 * np.cos(turn * 2 * np.pi * 4.0)
        crest = top * (0.72 + 0.28 * np.sin(np.clip(s, 0, 1) * np.pi)) * (0.35 + 0.65 * body) * strands
        result = np.maximum(result, crest * (body > 0))
    return result


def _dome(x: np.ndarray, y: np.ndarray, cx: float, cy: float, rx: float, ry: float, top: float) -> np.ndarray:
    q = ((x - cx) / rx) ** 2 + ((y - cy) / ry) ** 2
    return top * np.clip(1.0 - q, 0.0, 1.0) ** 0.6


def _blend(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """The larger of two heights with a fillet of about `width` metres between them."""
    k = np.clip(0.5 + 0.5 * (a - b) / width, 0.0, 1.0)
    return b + (a - b) * k + width * k * (1.0 - k)


def panel() -> tuple[Surface, np.ndarray]:
    """The relief as a mesh and what it lacks.

    Returns:
        A closed slab that faces +Z, centred on x = y = 0, its back at z = -0.06, texture coordinates
        in [0, 1]; and (DETAIL, DETAIL) metres: the fine heights for the normal map.
    """
    fine_count = MESH * 4 + 1
    fine = height(fine_count)
    # The mesh takes the mean around each of its points: sampling alone would alias the locks.
    soft = fine
    for axis in (0, 1, 0, 1, 0, 1):
        soft = (np.roll(soft, 1, axis) + 2 * soft + np.roll(soft, -1, axis)) / 4.0
    coarse = soft[::4, ::4]
    at = np.linspace(0.0, 1.0, MESH + 1)
    u, v = np.meshgrid(at, at)
    points = np.stack([(u - 0.5) * SIZE, (0.5 - v) * SIZE, coarse], -1)[::-1]
    front = grid(points, np.stack([u, v], -1)[::-1])
    half, back = SIZE / 2, -0.06
    sides = []
    edges = (points[0], points[-1][::-1], points[:, -1], points[::-1, 0])
    for row, normal in zip(edges, ((0, -1, 0), (0, 1, 0), (1, 0, 0), (-1, 0, 0))):
        skirt = np.stack([row * [1, 1, 0] + [0, 0, back], row])
        edge = grid(skirt, np.full((*skirt.shape[:2], 2), 0.01) + skirt[..., [2, 2]] * [0.05, 0.0])
        normals = np.tile(np.array(normal, dtype=np.float64), (len(edge.positions), 1))
        sides.append(Surface(edge.positions, normals, edge.uvs, edge.triangles))
    rear = np.array([(half, -half, back), (-half, -half, back), (-half, half, back), (half, half, back)])
    sides.append(polygon_face(rear, (0, 0, -1), np.full((4, 2), 0.01)))
    texel = (np.arange(DETAIL) + 0.5) / DETAIL
    full = _resample(fine, texel)
    detail = full - _resample(coarse, texel)
    grain = 0.0011 * noise(DETAIL, 72, 20, 200, 0.5)
    return merge(front, *sides), np.clip(detail, -0.02, 0.02) + grain


def _resample(field: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Bilinear interpolation of a square field, sampled from edge to edge, at (at x at) in [0, 1]."""
    position = at * (len(field) - 1)
    low = np.minimum(position.astype(int), len(field) - 2)
    f = position - low
    rows = field[low] * (1 - f)[:, None] + field[low + 1] * f[:, None]
    return rows[:, low] * (1 - f) + rows[:, low + 1] * f
