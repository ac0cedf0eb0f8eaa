"""Building parts: columns, arched walls, vaults, mouldings, balusters, roofs.

Each stands on y = 0 or keeps its building height, is closed, and faces +Z where it has a front.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .geometry import Surface, box, extrude, grid, lathe, merge, polygon_face, sweep, unit


def arc(cx: float, cy: float, radius: float, start: float, end: float, count: int) -> list[tuple[float, float]]:
    """Points on a circle, angles in degrees from +x counter-clockwise, both ends included."""
    angle = np.radians(np.linspace(start, end, count))
    return [(cx + radius * float(np.cos(a)), cy + radius * float(np.sin(a))) for a in angle]


def column(height: float, radius: float, segments: int, plinth: float, abacus: float, rows: int = 12) -> Surface:
    """A round column with Attic base, entasis, and a bell capital carved with two rows of leaves.

    Args:
        height: From the ground to the top of the abacus, metres.
        radius: Of the shaft at its foot.
        segments: Sides of the shaft; the capital has twice as many.
        plinth, abacus: Sides of the square slabs below and above.
        rows: Rings of the carved bell.
    """
    r = radius
    neck, bell = 0.84 * r, 1.7 * r
    slab, foot = 0.34 * r, 0.42 * r
    top = height - slab
    base = [(1.36 * r, foot)]
    base += arc(1.24 * r, foot + 0.17 * r, 0.17 * r, -60, 80, 4)
    base += arc(1.33 * r, foot + 0.50 * r, 0.16 * r, 235, 125, 3)
    base += arc(1.14 * r, foot + 0.74 * r, 0.11 * r, -75, 85, 3)
    base += [(1.04 * r, foot + 0.87 * r)]
    shaft_low, shaft_high = foot + 0.90 * r, top - bell
    rise = np.linspace(0.0, 1.0, 5)
    swell = r + (neck - r) * rise**1.8
    base += [(float(a), float(shaft_low + (shaft_high - shaft_low) * b)) for a, b in zip(swell, rise)]
    collar = [(neck, shaft_high - 0.02 * r), *arc(neck + 0.02 * r, shaft_high + 0.08 * r, 0.10 * r, -85, 85, 4)]
    collar.append((neck, shaft_high + 0.20 * r))
    plinth_slab = box((-plinth / 2, 0, -plinth / 2), (plinth / 2, foot, plinth / 2), skip="-y")
    half, bevel = abacus / 2, 0.10 * r
    outline = [(-half + bevel, top), (half - bevel, top), (half, top + bevel)]
    outline += [(half, height), (-half, height), (-half, top + bevel)]
    cushion = extrude(outline, abacus).moved(z=-half)
    turned = merge(lathe(base, segments, cap=False), lathe(collar, segments, cap=False))
    return merge(plinth_slab, turned, _bell(neck, top, bell, half, segments, rows), cushion)


def _bell(neck: float, top: float, height: float, half: float, segments: int, rows: int) -> Surface:
    """The carved part of a capital: a bell that opens upwards under two rows of leaves."""
    t = np.linspace(0.0, 1.0, rows + 1)
    turn = np.linspace(0.0, 2 * np.pi, 2 * segments + 1)
    open_ = neck + (half * 1.02 - neck) * t**2.2
    leaf = np.zeros((len(t), len(turn)))
    for low, high, phase in ((0.02, 0.50, 0.0), (0.36, 0.90, np.pi / 8)):
        s = np.clip((t - low) / (high - low), 0.0, 1.0)
        # A leaf leans out towards its tip and curls over there.
        out = (s**1.5 * (s < 1.0))[:, None]
        width = np.abs(np.cos(4.0 * (turn - phase)))[None, :]
        outline = np.clip((width - 0.75 * s[:, None] ** 3) * 3.0, 0.0, 1.0)
        rib = 1.0 - 0.25 * (1.0 - np.clip(width, 0.0, 1.0) ** 8)
        leaf = np.maximum(leaf, (0.12 + 0.34 * out) * neck * outline * rib * (s > 0)[:, None])
    radius = open_[:, None] + leaf
    level = np.repeat((top - height + height * t)[:, None], len(turn), 1)
    points = np.stack([radius * np.sin(turn), level, radius * np.cos(turn)], -1)
    points[:, -1] = points[:, 0]
    uvs = np.stack(np.broadcast_arrays(turn[None] * neck, -(height * t)[:, None]), -1)
    return grid(points, uvs, wrap_columns=True)


def square_pier(width: float, height: float) -> Surface:
    """A square pier with a stepped base and a moulded cap, metres."""
    h = width / 2
    base = mitred_ring([(0.0, 0.0), (0.07, 0.0), (0.07, 0.20), (0.03, 0.28), (0.0, 0.28)], h - 0.02, h - 0.02)
    cap = [(0.0, height - 0.30), (0.03, height - 0.30), (0.03, height - 0.25), (0.0, height - 0.24)]
    crown = [(0.0, height - 0.16), (0.03, height - 0.16), *arc(0.0, height - 0.09, 0.075, -55, 10, 4)]
    crown += [(0.09, height - 0.07), (0.09, height), (0.0, height)]
    return merge(
        box((-h, 0, -h), (h, height - 0.002, h), skip="-y"),
        base,
        mitred_ring(cap, h - 0.02, h - 0.02),
        mitred_ring(crown, h - 0.02, h - 0.02),
    )


def mitred_ring(profile: Sequence[tuple[float, float]], half_x: float, half_z: float, inward: bool = False) -> Surface:
    """A moulding around a rectangle with mitred corners.

    Args:
        profile: (outward, y) closed polygon, counter-clockwise.
        half_x, half_z: Half the sides of the rectangle that outward = 0 lies on, metres.
        inward: Let "outward" point to the middle, for the inside of a court.
    """
    sign = -1.0 if inward else 1.0
    # Clockwise from above with outward normals, so that cross(outward, up) runs along the path.
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)], dtype=np.float64)
    if inward:
        corners = corners[::-1]
    origins = np.stack([corners[:, 0] * half_x, np.zeros(4), corners[:, 1] * half_z], -1)
    out = sign * np.stack([corners[:, 0], np.zeros(4), corners[:, 1]], -1)
    return sweep(profile, origins, out, np.tile([0.0, 1.0, 0.0], (4, 1)), loop=True, smooth=False)


def run(profile: Sequence[tuple[float, float]], length: float) -> Surface:
    """A straight moulding along x, centred, that projects towards +Z; profile as in `mitred_ring`."""
    origins = np.array([[length / 2, 0.0, 0.0], [-length / 2, 0.0, 0.0]])
    return sweep(profile, origins, np.tile([0, 0, 1.0], (2, 1)), np.tile([0, 1.0, 0], (2, 1)), smooth=False)


def arched_wall(
    width: float, radius: float, spring: float, top: float, thickness: float, segments: int = 24
) -> Surface:
    """The wall over one arch, from the springing to `top`, centred on x = 0 and z = 0.

    Args:
        width: Of the bay, metres; the rest beside the opening stands on the columns.
        radius: Of the opening.
        spring: Height where the arch begins.
    """
    turn = np.linspace(np.pi, 0.0, segments + 1)
    curve = [(float(radius * np.cos(a)), float(spring + radius * np.sin(a))) for a in turn]
    h, z = width / 2, thickness / 2
    outline = [(-h, spring), *curve, (h, spring), (h, top), *[(x, top) for x, _ in curve[::-1]], (-h, top)]
    # Strips between curve and top give better triangles than ear clipping of the whole outline.
    lower = np.array([(-h, spring), *curve, (h, spring)])
    upper = np.stack([lower[:, 0], np.full(len(lower), top)], -1)
    parts = []
    for side in (1.0, -1.0):
        rows = np.stack([lower, upper])
        points = np.concatenate([rows, np.full((*rows.shape[:2], 1), side * z)], -1)
        points = points if side > 0 else points[:, ::-1]
        flat = grid(points, points[..., :2] * [side, -1.0])
        parts.append(Surface(flat.positions, np.tile([0, 0, side], (len(flat.positions), 1)), flat.uvs, flat.triangles))
    edge = np.array(outline + outline[:1])
    for a, b in zip(edge[:-1], edge[1:]):
        if np.hypot(*(b - a)) > 1e-9:
            normal = unit(np.array([b[1] - a[1], a[0] - b[0], 0.0]))
            parts.append(polygon_face(np.array([(*a, -z), (*b, -z), (*b, z), (*a, z)]), normal))
    return merge(*parts)


def archivolt(radius: float, spring: float, depth: float, band: float, segments: int = 24) -> Surface:
    """The moulded ring of an arch, passing through the wall and standing out on both faces.

    Args:
        radius: Clear radius, metres.
        depth: Of the ring along the passage (thicker than the wall).
        band: Width of the ring.
    """
    d = depth / 2
    # a: along the passage, b: away from the centre of the arch.
    profile = [(-d + 0.02, 0.0), (d - 0.02, 0.0), (d - 0.02, band * 0.45), (d, band * 0.5), (d, band * 0.9)]
    profile += [(d - 0.05, band), (-d + 0.05, band), (-d, band * 0.9), (-d, band * 0.5), (-d + 0.02, band * 0.45)]
    turn = np.linspace(0.0, np.pi, segments + 1)
    out = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], -1)
    origins = radius * out + [0.0, spring, 0.0]
    # cross(a, b) = cross(+Z, out) turns counter-clockwise, as the path does.
    return sweep(profile, origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)), out)


def groin_vault(width: float, depth: float, spring: float, rise: float, top: float, steps: int = 6) -> Surface:
    """A closed block whose underside is the crossing of two (elliptical) barrels, centred on the axis.

    Args:
        width, depth: Plan in x and z, metres.
        spring, rise: Height of the springing, and of the crown above it.
        top: Height of the flat upper side.
    """
    hx, hz = width / 2, depth / 2
    parts = []
    # Even steps in angle, so that the steep feet of the barrels are round too.
    s = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 2 * steps + 1))
    for quarter in range(4):
        a, b = (hx, hz) if quarter % 2 == 0 else (hz, hx)
        # The web between the groins against side +b: a barrel that runs along b, seen from below.
        across = np.linspace(0.0, 1.0, steps + 1)
        u = np.repeat(s[None, :], steps + 1, 0)
        v = np.abs(u) + (1.0 - np.abs(u)) * across[:, None]
        height = spring + rise * np.sqrt(np.maximum(1.0 - u * u, 0.0))
        points = np.stack([u * a, height, v * b], -1)
        uvs = np.stack([np.arcsin(np.clip(u, -1, 1)) * a, v * b], -1)
        web = grid(points, uvs)
        angle = np.arcsin(np.clip(u, -1.0, 1.0))
        normal = unit(np.stack([-np.sin(angle) / a, -np.cos(angle) / rise, np.zeros_like(angle)], -1).reshape(-1, 3))
        parts.append(Surface(web.positions, normal, web.uvs, web.triangles).turned("y", 90.0 * quarter))
        curve = np.array([(x * a, spring + rise * float(np.sqrt(max(1.0 - x * x, 0.0)))) for x in s])
        lunette = np.stack([curve, np.stack([curve[:, 0], np.full(len(curve), top)], -1)])
        face = grid(np.concatenate([lunette, np.full((2, len(curve), 1), b)], -1), lunette * [1.0, -1.0])
        parts.append(face.turned("y", 90.0 * quarter))
    lid = [(-hx, top, hz), (hx, top, hz), (hx, top, -hz), (-hx, top, -hz)]
    return merge(*parts, polygon_face(np.array(lid), (0.0, 1.0, 0.0)))


def rib(radius: float, spring: float, width: float, low: float, high: float, segments: int = 16) -> Surface:
    """A plain half-round arch band across z (its plane is x = 0), from `low` to `high` metres off the axis."""
    turn = np.linspace(0.0, np.pi, segments + 1)
    out = np.stack([np.zeros_like(turn), np.sin(turn), np.cos(turn)], -1)
    h = width / 2
    profile = [(-h, low - radius), (-h + 0.03, low - radius - 0.03), (h - 0.03, low - radius - 0.03), (h, low - radius)]
    profile += [(h, high - radius), (-h, high - radius)]
    across = np.tile([-1.0, 0.0, 0.0], (len(turn), 1))
    return sweep(profile, radius * out + [0.0, spring, 0.0], across, out)


def baluster(height: float, radius: float, segments: int = 10) -> Surface:
    """A turned baluster without end caps (they stand between rails)."""
    r, h = radius, height
    profile = [(0.80 * r, 0.0), (0.80 * r, 0.09 * h), (0.45 * r, 0.13 * h), (0.92 * r, 0.27 * h), (0.92 * r, 0.40 * h)]
    profile += [(0.44 * r, 0.74 * h), (0.40 * r, 0.85 * h), (0.72 * r, 0.90 * h), (0.72 * r, h)]
    return lathe(profile, segments, cap=False)


def tiled_roof(runs: Sequence[float], pitch: float, slope: float) -> Surface:
    """Rows of half-round tiles that run down from a ridge at z = 0, y = 0 towards +Z, centred in x.

    Args:
        runs: Horizontal length of each row from left to right, metres.
        pitch: Width of one row.
        slope: Drop per metre.
    """
    turn = np.linspace(0.0, np.pi, 5)
    cross = np.stack([-np.cos(turn) * pitch * 0.52, np.sin(turn) * pitch * 0.36, np.zeros_like(turn)], -1)
    down = np.array([0.0, -slope, 1.0])
    rows = []
    for number, length in enumerate(runs):
        x = (number + 0.5 - len(runs) / 2) * pitch
        count = max(1, round(length))
        for i in range(count):
            # Each tile is lifted a little at its lower end, where it lies on the next.
            high, low = down * (length * i / count), down * (length * (i + 1) / count + 0.04) + [0.0, 0.035, 0.0]
            points = np.stack([low, high])[:, None] + cross[None] + [x, 0.0, 0.0]
            shift = [0.37 * (i + 3 * number), 0.0]
            rows.append(grid(points, points[..., [0, 2]] + shift))
            lip = np.concatenate([points[0], [low + [x, -0.03, 0.0]]])
            rows.append(polygon_face(lip[::-1], (0.0, 0.0, 1.0)))
    return merge(*rows)
