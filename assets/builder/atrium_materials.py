"""The materials of the atrium, with their textures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import textures as t
from .glb import MaterialHandle, SceneBuilder


@dataclass(frozen=True)
class Palette:
    """Every material of the atrium.

    Attributes:
        ashlar: Dressed blocks in courses: facades.
        trim: Smooth pale limestone: columns, arches, mouldings.
        plaster: Vaults and gallery walls.
        pavement: Slabs of the court.
        bricks: Herringbone floor of the galleries.
        wood: Doors and beams.
        terracotta, tiles: Pots; the roof.
        soil, leaves: Plants; leaves are alpha-masked cards with coordinates of their own.
        relief: The stone of the relief, with coordinates of its own.
        cloth: Hangings by colour name, woven; "gold" is also the border.
        iron: Rods and rings.
    """

    ashlar: MaterialHandle
    trim: MaterialHandle
    plaster: MaterialHandle
    pavement: MaterialHandle
    bricks: MaterialHandle
    wood: MaterialHandle
    terracotta: MaterialHandle
    tiles: MaterialHandle
    soil: MaterialHandle
    leaves: MaterialHandle
    relief: MaterialHandle
    cloth: dict[str, MaterialHandle]
    iron: MaterialHandle


CLOTH = {"red": (0.80, 0.07, 0.05), "green": (0.07, 0.50, 0.14), "blue": (0.06, 0.16, 0.70), "gold": (0.84, 0.52, 0.08)}


def palette(scene: SceneBuilder, relief_detail: np.ndarray, relief_size: float) -> Palette:
    """Makes all materials.

    Args:
        relief_detail: (S, S) metres: fine heights of the relief that its mesh does not have.
        relief_size: Side of the relief in metres.
    """

    def pair(name: str, albedo: np.ndarray, height: np.ndarray, tile: float, **options) -> MaterialHandle:
        color = scene.texture(f"{name} color", t.encode_color(albedo), "image/jpeg")
        normal = scene.texture(f"{name} normal", t.encode_normals(t.normals(height, tile)), "image/jpeg")
        return scene.material(name, color_texture=color, normal_texture=normal, tile=tile, **options)

    weave = scene.texture("weave normal", t.encode_normals(t.normals(*_weave())), "image/jpeg")
    damask = scene.texture("damask color", t.encode_color(_damask()), "image/jpeg")
    cloth = {
        name: scene.material(
            f"{name} cloth", color, 0.9, color_texture=damask, normal_texture=weave, tile=0.7, double_sided=True
        )
        for name, color in CLOTH.items()
    }
    mottle = scene.texture("mottle color", t.encode_color(_mottle()), "image/jpeg")
    leaf = scene.texture("leaf color", t.encode_alpha(*_sprig()), "image/png")
    size = len(relief_detail)
    weathered = 1.0 + 0.05 * t.noise(size, 71, 2, 60, 1.0) + 14.0 * np.clip(relief_detail, -0.006, 0.006)
    relief_color = scene.texture("relief color", t.encode_color(t.tint((0.62, 0.55, 0.44), weathered)), "image/jpeg")
    relief_normal = scene.texture(
        "relief normal", t.encode_normals(t.normals(relief_detail, relief_size, wrap=False)), "image/jpeg"
    )
    return Palette(
        ashlar=pair("ashlar", *_ashlar(), 2.8, roughness=0.9),
        trim=pair("limestone", *_limestone(), 1.4, roughness=0.75),
        plaster=scene.material("plaster", (0.70, 0.62, 0.51), 1.0, color_texture=mottle, tile=3.1),
        pavement=pair("pavement", *_pavement(), 1.55, roughness=0.7),
        bricks=pair("bricks", *_bricks(), 1.2, roughness=0.85),
        wood=pair("wood", *_wood(), 1.0, roughness=0.8),
        terracotta=scene.material("terracotta", (0.58, 0.26, 0.14), 0.9, color_texture=mottle, tile=1.3),
        # The lowest tiles are seen from inside too, from under the eaves.
        tiles=scene.material(
            "roof tiles", (0.36, 0.13, 0.065), 1.0, color_texture=mottle, tile=1.3, double_sided=True
        ),
        soil=scene.material("soil", (0.09, 0.06, 0.04), 1.0),
        leaves=scene.material(
            "leaves", roughness=0.8, color_texture=leaf, tile=None, mask=0.5, double_sided=True
        ),
        relief=scene.material(
            "relief stone", roughness=0.85, color_texture=relief_color, normal_texture=relief_normal, tile=None
        ),
        cloth=cloth,
        iron=scene.material("iron", (0.06, 0.055, 0.05), 0.7),
    )


def _ashlar() -> tuple[np.ndarray, np.ndarray]:
    size = 1024
    block, edge = t.courses(size, 2.8, 8, (0.5, 0.95), seed=11)
    joint = t.smoothstep(0.010, 0.004, edge)
    grain = t.noise(size, 12, 20, 170, 0.6)
    stain = t.noise(size, 13, 1, 12, 1.2)
    pits = np.clip(t.noise(size, 14, 30, 200, 0.3) - 1.6, 0.0, 1.5)
    shade = 1.0 + t.per_block(block, 15, 0.07) + 0.035 * grain + 0.05 * stain - 0.12 * pits - 0.28 * joint
    warm = np.stack([np.ones_like(shade), 1.0 + t.per_block(block, 16, 0.006), 1.0 + t.per_block(block, 17, 0.02)], -1)
    bevel = t.smoothstep(0.0, 0.022, edge)
    height = 0.010 * bevel + t.per_block(block, 18, 0.0008) + 0.0007 * grain - 0.003 * pits + 0.0012 * stain
    return t.tint((0.60, 0.53, 0.42), shade) * warm, height


def _limestone() -> tuple[np.ndarray, np.ndarray]:
    size = 512
    cloud, grain = t.noise(size, 21, 1, 20, 1.4), t.noise(size, 22, 20, 250, 0.4)
    vein = np.exp(-((t.noise(size, 23, 1, 12, 1.3) / 0.05) ** 2))
    pits = np.clip(t.noise(size, 24, 20, 120, 0.4) - 1.9, 0.0, 1.0)
    shade = 1.0 + 0.045 * cloud + 0.022 * grain - 0.05 * vein - 0.15 * pits
    return t.tint((0.64, 0.58, 0.48), shade), 0.0005 * grain - 0.0015 * pits + 0.0007 * cloud


def _mottle() -> np.ndarray:
    size = 512
    shade = 0.9 + 0.05 * t.noise(size, 31, 1, 16, 1.1) + 0.02 * t.noise(size, 32, 16, 250, 0.4)
    return t.tint((1.0, 1.0, 1.0), np.clip(shade, 0.0, 1.0))


def _pavement() -> tuple[np.ndarray, np.ndarray]:
    """Pale octagons with small dark squares set in their corners."""
    size, tile, count = 512, 1.55, 2
    block, edge = t.slabs(size, tile, count)
    side = tile / count
    at = (np.arange(size) + 0.5) / size * tile % side
    corner = np.minimum(at, side - at)
    diamond = corner[:, None] + corner[None, :]
    inset = diamond < 0.17
    edge = np.where(inset, (0.17 - diamond) / np.sqrt(2.0), np.minimum(edge, (diamond - 0.17) / np.sqrt(2.0)))
    joint = t.smoothstep(0.006, 0.002, edge)
    grain, stain = t.noise(size, 42, 10, 250, 0.7), t.noise(size, 43, 1, 9, 1.0)
    shade = 1.0 + 0.04 * grain + 0.04 * stain - 0.35 * joint
    alternate = (block // count + block % count) % 2
    pale = np.where(alternate[..., None] == 0, (0.50, 0.45, 0.375), (0.40, 0.335, 0.265)) * shade[..., None]
    dark = np.array((0.13, 0.11, 0.10)) * (shade + 0.5 * (shade - 1.0))[..., None]
    height = 0.004 * t.smoothstep(0.0, 0.010, edge) + 0.0003 * grain + 0.0008 * stain
    return np.where(inset[..., None], dark, pale), height


def _bricks() -> tuple[np.ndarray, np.ndarray]:
    size = 512
    block, edge = t.herringbone(size, 1.2, 12)
    joint = t.smoothstep(0.006, 0.002, edge)
    grain = t.noise(size, 52, 8, 250, 0.6)
    shade = 1.0 + t.per_block(block, 53, 0.10) + 0.05 * grain
    clay = t.tint((0.52, 0.33, 0.22), shade)
    mortar = t.tint((0.40, 0.34, 0.27), 1.0 + 0.05 * grain)
    height = 0.005 * t.smoothstep(0.0, 0.012, edge) + t.per_block(block, 54, 0.0004) + 0.0005 * grain
    return np.where(joint[..., None] > 0.5, mortar, clay), height


def _wood() -> tuple[np.ndarray, np.ndarray]:
    """Boards that run along u."""
    size = 512
    at = (np.arange(size) + 0.5) / size
    board = np.repeat((at * 4).astype(int)[:, None], size, axis=1)
    rest = at * 4 % 1.0
    gap = np.repeat(t.smoothstep(0.035, 0.01, np.minimum(rest, 1.0 - rest))[:, None], size, axis=1)
    fibre = t.noise(size, 61, 4, 250, 0.8, stretch=0.06)
    shade = 1.0 + t.per_block(board, 62, 0.10) + 0.16 * fibre - 0.6 * gap
    return t.tint((0.29, 0.165, 0.088), np.clip(shade, 0.2, 2.0)), 0.0006 * fibre - 0.004 * gap


def _weave() -> tuple[np.ndarray, float]:
    """Threads over and under; (height in metres, side in metres)."""
    size, threads, tile = 256, 48, 0.7
    at = (np.arange(size) + 0.5) / size * threads * np.pi
    warp, weft = np.abs(np.sin(at))[None, :], np.abs(np.sin(at))[:, None]
    over = (np.sin(at / 1.0)[None, :] * np.sin(at / 1.0)[:, None]) > 0
    height = np.where(over, warp, weft * 0.9) + 0.15 * t.noise(size, 64, 2, 60, 0.6)
    return height * 0.0006, tile


def _damask() -> np.ndarray:
    """A woven figure, brighter on darker, to be tinted by the colour of the cloth."""
    size = 512
    at = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    figure = np.zeros((size, size))
    for dx, dy in ((0.0, 0.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
        x, y = np.meshgrid(at - dx, at - dy)
        r, angle = np.hypot(x, y), np.arctan2(x, -y)
        petals = 0.30 + 0.13 * np.abs(np.cos(3.0 * angle)) + 0.05 * np.cos(angle)
        ring = np.abs(r - 0.62 - 0.03 * np.cos(12 * angle)) - 0.022
        figure = np.maximum(figure, t.smoothstep(0.012, -0.012, r - petals) * t.smoothstep(-0.01, 0.01, r - 0.13))
        figure = np.maximum(figure, t.smoothstep(0.012, -0.012, ring))
        figure = np.maximum(figure, t.smoothstep(0.012, -0.012, r - 0.075))
    shade = 0.80 + 0.18 * figure + 0.02 * t.noise(size, 65, 10, 200, 0.3)
    return t.tint((1.0, 1.0, 1.0), np.clip(shade, 0.0, 1.0))


def _sprig() -> tuple[np.ndarray, np.ndarray]:
    """A stem with leaves on both sides; (albedo, coverage)."""
    size = 256
    at = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(at, 1.0 - at)
    cover, shade = np.zeros((size, size)), np.ones((size, size))
    stem = t.smoothstep(0.010, 0.005, np.abs(x - 0.5 - 0.02 * np.sin(6 * y))) * (y < 0.86)
    cover, shade = np.maximum(cover, stem), np.where(stem > 0.5, 0.8, shade)
    leaves = [(0.06 + 0.135 * i, side) for i in range(6) for side in (-1.0, 1.0)] + [(0.70, 0.0)]
    for number, (base, side) in enumerate(leaves):
        tilt = np.radians(52.0 - 5.0 * (number // 2)) * side
        length = 0.46 - 0.018 * number if side else 0.28
        u = (x - 0.5) * np.sin(tilt) + (y - base) * np.cos(tilt)
        v = (x - 0.5) * np.cos(tilt) - (y - base) * np.sin(tilt)
        along = np.clip(u / length, 0.0, 1.0)
        half = 0.066 * np.sin(np.pi * along**0.75) * (1.0 - 0.35 * along)
        leaf = t.smoothstep(0.006, -0.006, np.abs(v) - half) * ((u > 0) & (u < length))
        rib = np.exp(-((v / 0.006) ** 2)) * 0.35
        side_ribs = 0.10 * np.cos((u - np.abs(v) * 0.8) * 110.0)
        tone = 0.86 + 0.22 * ((number * 7) % 5 / 4.0) + rib + side_ribs * (half > 0.02)
        shade = np.where(leaf > 0.5, tone, shade)
        cover = np.maximum(cover, leaf)
    green = np.stack([0.13 * shade + 0.02, 0.30 * shade, 0.055 * shade], axis=-1)
    return green, cover
