"""What furnishes the atrium: hangings, plants, doors, the fountain.

Each function gives (material, surface) parts for one mesh that stands or hangs at the origin.
"""

from __future__ import annotations

import numpy as np

from .architecture import run
from .atrium_materials import Palette
from .geometry import Surface, box, grid, lathe, merge, rotation, sphere, torus, unit

Part = tuple[object, Surface]


def banner(palette: Palette, color: str, width: float, drop: float, seed: int) -> list[Part]:
    """A straight hanging on a rod along x; its top is y = 0, its lower hem y = -drop."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0.0, 2 * np.pi, 3)

    def shape(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        fold = np.sin(2 * np.pi * 4.0 * u + phases[0] + 0.5 * v)
        fold += 0.45 * np.sin(2 * np.pi * 7.0 * u + phases[1] - 0.8 * v)
        amplitude = 0.030 + 0.035 * v
        sway = 0.03 * np.sin(np.pi * v + phases[2])
        narrow = 1.0 - 0.05 * v
        return np.stack([(u - 0.5) * width * narrow, -drop * v, fold * amplitude + sway], -1)

    return _cloth(palette, color, shape, width * 1.15, drop) + [_rod(palette, width + 0.2)]


def drawn_curtain(palette: Palette, color: str, width: float, drop: float, side: float, seed: int) -> list[Part]:
    """A curtain tied back to one side of the opening: `side` -1 to the left, +1 to the right."""
    phase = np.random.default_rng(seed).uniform(0.0, 2 * np.pi)
    tie = 0.60

    def shape(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        above = np.clip(v / tie, 0.0, 1.0)
        below = np.clip((v - tie) / (1.0 - tie), 0.0, 1.0)
        part = 1.0 - 0.80 * above**1.7 + 0.22 * np.sin(below * np.pi * 0.62)
        gathered = 1.0 - part
        fold = np.sin(2 * np.pi * 7.0 * u + phase + 0.4 * np.sin(5.0 * v))
        x = side * (width / 2 - width * part * u)
        # Cloth hangs down from the rod in a curve before it reaches the tie.
        sag = 0.10 * np.sin(np.pi * above) * u
        z = fold * (0.022 + 0.055 * gathered) + 0.02 * np.sin(7.0 * u)
        points = np.stack([x, -drop * v - sag, z], -1)
        # Mirrored x would turn the front away.
        return points if side < 0 else points[:, ::-1]

    band = torus(0.17, 0.030, 8, 20).scaled(1.0, 1.0, 0.75)
    band = band.moved(x=side * (width / 2 - 0.10 * width), y=-drop * tie)
    sheet = _cloth(palette, color, shape, width * 1.2, drop)
    return [*sheet, (palette.cloth["gold"], band), _rod(palette, width + 0.1)]


def _cloth(palette: Palette, color: str, shape, width: float, drop: float) -> list[Part]:
    """A single sheet in three bands: field, golden border, hem."""
    columns, rows = 57, 19
    trim = "red" if color == "gold" else "gold"
    field, border = 1.0 - 0.34 / drop, 1.0 - 0.10 / drop
    levels = np.concatenate([np.linspace(0.0, field, rows - 4), np.linspace(border, 1.0, 3)])
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), levels[::-1])
    points = shape(u, v)
    whole = grid(points, np.stack([u * width, v * drop], -1))
    level = levels[::-1]
    row_of_triangle = whole.triangles.min(axis=1) // columns
    in_border = (level[row_of_triangle] <= border + 1e-9) & (level[row_of_triangle] > field + 1e-9)
    return [(palette.cloth[color], _pick(whole, ~in_border)), (palette.cloth[trim], _pick(whole, in_border))]


def _pick(surface: Surface, chosen: np.ndarray) -> Surface:
    """The chosen triangles with only the vertices they use; normals stay those of the whole."""
    used, triangles = np.unique(surface.triangles[chosen], return_inverse=True)
    return Surface(surface.positions[used], surface.normals[used], surface.uvs[used], triangles.reshape(-1, 3))


def _rod(palette: Palette, length: float) -> Part:
    knob = sphere(0.035, 6, 10)
    bar = lathe([(0.016, -length / 2), (0.016, length / 2)], 8).turned("z", 90.0)
    return palette.iron, merge(bar, knob.moved(x=length / 2), knob.moved(x=-length / 2)).moved(y=0.01)


def rug(palette: Palette, color: str, width: float) -> list[Part]:
    """A rug that lies over a balustrade: y = 0 is the rail's top, the longer end hangs at +Z."""
    over = [(-0.175, -0.42), (-0.17, -0.2), (-0.165, -0.02), (-0.13, 0.012), (0.0, 0.015), (0.13, 0.012)]
    over += [(0.165, -0.02), (0.17, -0.25), (0.178, -0.5), (0.19, -0.76)]
    path = np.array(over)[::-1]
    v = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    u = np.linspace(-0.5, 0.5, 25) * width
    hang = np.clip(-path[:, 1], 0.0, 1.0)
    wave = 0.030 * np.sin(u * 21.0)[None, :] * hang[:, None] * np.sign(path[:, :1])
    z = path[:, :1] + wave + 0.03 * hang[:, None] * np.sign(path[:, :1])
    points = np.stack([np.repeat(u[None], len(path), 0), np.repeat(path[:, 1:], len(u), 1), z], -1)
    sheet = grid(points, np.stack(np.broadcast_arrays(u[None], v[-1] - v[:, None]), -1))
    border = np.abs(sheet.positions[:, 0]) > 0.43 * width
    edge = border[sheet.triangles].all(axis=1)
    trim = "red" if color == "gold" else "gold"
    return [(palette.cloth[color], _pick(sheet, ~edge)), (palette.cloth[trim], _pick(sheet, edge))]


def pot(radius: float, height: float, segments: int = 28) -> Surface:
    """A terracotta pot with a rolled rim and two raised bands; open at the top, with an inner wall."""
    r, h = radius, height
    profile = [(0.62 * r, 0.0), (0.66 * r, 0.02 * h), (0.66 * r, 0.06 * h), (0.62 * r, 0.09 * h)]
    profile += [(0.76 * r, 0.32 * h), (0.90 * r, 0.60 * h), (0.935 * r, 0.62 * h), (0.935 * r, 0.66 * h)]
    profile += [(0.91 * r, 0.68 * h), (0.96 * r, 0.86 * h), (1.05 * r, 0.88 * h), (1.08 * r, 0.93 * h)]
    profile += [(1.06 * r, 0.98 * h), (1.0 * r, h), (0.90 * r, 0.98 * h), (0.86 * r, 0.80 * h), (0.0, 0.80 * h)]
    return lathe(profile, segments)


def bush(palette: Palette, seed: int, radius: float = 0.45, cards: int = 90) -> list[Part]:
    """A round shrub in a pot."""
    height = 0.62
    earth = lathe([(0.30, 0.0), (0.30, 0.01), (0.0, 0.03)], 20, cap=False).moved(y=0.84 * height)
    rng = np.random.default_rng(seed)
    foliage = _crown(rng, cards, radius, 0.30).scaled(1.0, 1.05, 1.0).moved(y=height + 0.55 * radius)
    return [(palette.terracotta, pot(0.36, height)), (palette.soil, earth), (palette.leaves, foliage)]


def tree(palette: Palette, seed: int) -> list[Part]:
    """A small orange tree in a large pot."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 7)
    trunk = lathe([(float(0.055 - 0.02 * a), float(0.5 + 1.0 * a)) for a in t], 10, cap=False)
    bend = 0.05 * np.sin((trunk.positions[:, 1] - 0.5) * 3.0)
    bent = trunk.positions + np.stack([bend, 0 * bend, 0.6 * bend], -1)
    trunk = Surface(bent, trunk.normals, trunk.uvs, trunk.triangles)
    crown = _crown(rng, 230, 0.62, 0.34).moved(y=1.85)
    fruits = []
    for _ in range(16):
        out = unit(rng.standard_normal(3)) * [1.0, 0.8, 1.0] * 0.60
        fruits.append(sphere(0.042, 6, 9).moved(*(out + [0.0, 1.82, 0.0])))
    earth = lathe([(0.38, 0.0), (0.38, 0.01), (0.0, 0.03)], 20, cap=False).moved(y=0.53)
    return [
        (palette.terracotta, pot(0.45, 0.66)),
        (palette.soil, earth),
        (palette.wood, trunk),
        (palette.leaves, crown),
        (palette.cloth["gold"], merge(*fruits)),
    ]


def _crown(rng: np.random.Generator, cards: int, radius: float, size: float) -> Surface:
    """Leaf cards that point outwards from a ball, slightly bent, with coordinates in [0, 1]."""
    parts = []
    for i in range(cards):
        # A Fibonacci lattice spreads them evenly.
        y = 1.0 - 2.0 * (i + 0.5) / cards
        angle = i * 2.399963 + rng.uniform(-0.3, 0.3)
        ring = np.sqrt(max(1.0 - y * y, 0.0))
        out = np.array([ring * np.cos(angle), y, ring * np.sin(angle)])
        lean = unit(out + 0.55 * rng.standard_normal(3) + [0.0, 0.25, 0.0])
        right = unit(np.cross(lean, unit(rng.standard_normal(3))))
        front = np.cross(right, lean)
        start = out * radius * rng.uniform(0.45, 0.85) - lean * size * 0.35
        s = size * rng.uniform(0.75, 1.2)
        rows = np.linspace(0.0, 1.0, 3)
        points = np.stack(
            [start + side * right * s * 0.5 + lean * s * t - front * s * 0.18 * t * t for t in rows for side in (-1, 1)]
        )
        # Texture coordinates stay off the border, where repeating would bring in the opposite edge.
        uvs = np.stack([np.tile([0.01, 0.99], 3), np.repeat(0.99 - 0.98 * rows, 2)], -1)
        parts.append(grid(points.reshape(3, 2, 3), uvs.reshape(3, 2, 2)))
    return merge(*parts)


def door(palette: Palette, width: float = 1.1, height: float = 2.15) -> list[Part]:
    """A panelled double door in a stone surround; its back is z = 0, it faces +Z."""
    w, h = width / 2, height
    leaf = [box((-w, 0.01, 0.0), (w, h, 0.05), skip="-z-y")]
    for x in (-w / 2, w / 2):
        for low, high in ((0.12, 0.62), (0.74, 1.34), (1.46, h - 0.12)):
            frame = (x - w / 2 + 0.08, x + w / 2 - 0.08)
            leaf.append(box((frame[0], low, 0.04), (frame[1], high, 0.072), skip="-z"))
    wood = merge(*leaf)
    wood = wood.with_uvs(wood.uvs[:, ::-1])
    post = box((-0.10, 0.0, 0.0), (0.10, h + 0.02, 0.13), skip="-z-y")
    jamb = [post.moved(x=-w - 0.09), post.moved(x=w + 0.09)]
    lintel = box((-w - 0.21, h - 0.02, 0.0), (w + 0.21, h + 0.24, 0.14), skip="-z")
    crown = run([(0.0, h + 0.23), (0.15, h + 0.23), (0.22, h + 0.31), (0.22, h + 0.36), (0.0, h + 0.38)], width + 0.56)
    knob = sphere(0.028, 6, 10)
    rings = merge(knob.moved(-0.05, 1.08, 0.075), knob.moved(0.05, 1.08, 0.075))
    return [(palette.wood, wood), (palette.trim, merge(*jamb, lintel, crown)), (palette.iron, rings)]


def fountain(palette: Palette, seed: int) -> list[Part]:
    """An eight-sided basin planted with shrubs around a stone bowl."""
    rng = np.random.default_rng(seed)
    basin = [(1.32, -0.2), (1.32, 0.0), (1.22, 0.0), (1.22, 0.08), (1.13, 0.14), (1.13, 0.38)]
    basin += [(1.24, 0.44), (1.24, 0.52), (1.0, 0.52), (1.0, 0.40), (0.0, 0.40)]
    wall = lathe(basin, 8).turned("y", 22.5)
    # Eight flat sides: the normals of a lathe would round them off.
    wall = _faceted(wall)
    bowl = [(0.26, 0.38), (0.26, 0.46), (0.20, 0.50), (0.12, 0.58), (0.11, 0.72), (0.16, 0.84)]
    bowl += [(0.13, 0.88), (0.20, 0.90), (0.40, 0.97), (0.54, 1.06), (0.60, 1.16), (0.62, 1.18), (0.60, 1.20)]
    bowl += [(0.56, 1.18), (0.30, 1.06), (0.12, 1.03), (0.10, 1.10), (0.13, 1.20), (0.10, 1.29), (0.0, 1.34)]
    shrubs = []
    for i in range(9):
        turn = i * 40.0 + rng.uniform(-6, 6)
        at = rotation("y", turn) @ np.array([0.66, 0.47, 0.0])
        shrubs.append(_crown(rng, 26, 0.20, 0.26).moved(*at))
    earth = lathe([(0.99, 0.0), (0.0, 0.02)], 8, cap=False).turned("y", 22.5).moved(y=0.42)
    return [
        (palette.trim, merge(wall, lathe(bowl, 36))),
        (palette.soil, earth),
        (palette.leaves, merge(*shrubs)),
    ]


def _faceted(surface: Surface) -> Surface:
    corners = surface.triangles.reshape(-1)
    p = surface.positions[corners].reshape(-1, 3, 3)
    face = unit(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
    index = np.arange(len(corners)).reshape(-1, 3)
    return Surface(p.reshape(-1, 3), np.repeat(face, 3, axis=0), surface.uvs[corners], index)
