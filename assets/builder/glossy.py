"""`glossy`: bright and coloured things on a shiny floor, to see glossy indirect reflections.

The floor is dark polished metal (roughness 0.2), so what it shows is almost nothing but reflection. A pale
wall stands behind. Floor 18 x 9 m; the group stands around the origin, about 5 m wide.
"""

from __future__ import annotations

import numpy as np

from .geometry import Surface, box, grid, lathe, merge, polygon_face, sphere, torus
from .glb import SceneBuilder


def build() -> SceneBuilder:
    """The scene, ready to be written."""
    scene = SceneBuilder(background=(0.02, 0.025, 0.035))
    floor = scene.material("polished metal", (0.42, 0.43, 0.46), roughness=0.2, metallic=0.9)
    wall = scene.material("pale wall", (0.66, 0.64, 0.60), roughness=1.0)
    red = scene.material("red", (0.75, 0.06, 0.04), roughness=0.6)
    green = scene.material("green", (0.07, 0.48, 0.13), roughness=0.6)
    blue = scene.material("blue", (0.05, 0.15, 0.65), roughness=0.6)
    yellow = scene.material("yellow", (0.83, 0.58, 0.06), roughness=0.6)
    white = scene.material("white", (0.75, 0.74, 0.72), roughness=0.8)
    ember = scene.material("glowing orange", (0.2, 0.2, 0.2), roughness=0.8, emission=(7.0, 2.6, 0.5))
    ice = scene.material("glowing cyan", (0.2, 0.2, 0.2), roughness=0.8, emission=(0.6, 3.0, 4.2))

    scene.place("floor", scene.mesh("floor", (floor, box((-9.0, -0.3, -3.0), (9.0, 0.0, 6.0)))))
    scene.place("back wall", scene.mesh("back wall", (wall, box((-9.0, 0.0, -3.3), (9.0, 5.0, -3.0)))))
    scene.place("sphere", scene.mesh("sphere", (red, sphere(0.62, 32, 64))), (-0.75, 0.62, 0.35))
    block, bar = box((-0.45, 0, -0.45), (0.45, 1.25, 0.45)), box((-0.09, 0, -0.09), (0.09, 1.7, 0.09))
    scene.place("box", scene.mesh("box", (blue, block)), (0.75, 0.0, -0.75), turn=28.0)
    scene.place("torus", scene.mesh("torus", (yellow, torus(0.48, 0.17, 24, 64))), (0.75, 0.17, 0.95))
    scene.place("cone", scene.mesh("cone", (green, cone(0.5, 1.35, 64))), (2.0, 0.0, 0.15))
    scene.place("twisted column", scene.mesh("twisted column", (white, twisted_column(0.34, 2.3))), (-2.05, 0.0, -0.55))
    scene.place("glowing ball", scene.mesh("glowing ball", (ember, sphere(0.22, 20, 40))), (-1.75, 0.22, 1.15))
    scene.place("glowing bar", scene.mesh("glowing bar", (ice, bar)), (2.85, 0.0, -1.1))
    scene.light("sun", "directional", 2.6, (1.0, 0.95, 0.88), direction=(0.55, -1.0, -0.75))
    scene.light("lamp", "point", 7.0, (0.85, 0.92, 1.0), position=(-2.6, 3.0, 2.4))
    scene.camera("front", (0.35, 1.55, 5.6), (0.1, 0.55, 0.0), fov=42.0)
    return scene


def cone(radius: float, height: float, segments: int) -> Surface:
    """A cone on y = 0 whose sides are shaded smoothly up to the tip."""
    angle = np.linspace(0.0, 2 * np.pi, segments + 1)
    circle = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], -1)
    circle[-1] = circle[0]
    levels = np.linspace(0.0, 1.0, 9)
    points = np.stack([circle * radius * (1.0 - t) + [0.0, height * t, 0.0] for t in levels])
    shell = grid(points, np.stack(np.meshgrid(angle, levels), -1), wrap_columns=True)
    # A cone's normal does not depend on the height; at the tip, area weights would tilt it straight up.
    side = np.tile((circle * height + [0.0, radius, 0.0]) / np.hypot(height, radius), (len(levels), 1))
    shell = Surface(shell.positions, side, shell.uvs, shell.triangles)
    return merge(shell, polygon_face(circle[:-1][::-1] * radius, (0.0, -1.0, 0.0)))


def twisted_column(radius: float, height: float, lobes: int = 5, turns: float = 0.75) -> Surface:
    """A column with a lobed section that turns as it rises, between two round discs."""
    angle = np.linspace(0.0, 2 * np.pi, 16 * lobes + 1)
    levels = np.linspace(0.12, height - 0.12, 61)
    phase = (levels - levels[0]) / (levels[-1] - levels[0]) * turns * 2 * np.pi
    r = radius * (0.78 + 0.14 * np.cos(lobes * (angle[None, :] - phase[:, None])))
    points = np.stack([r * np.sin(angle), np.repeat(levels[:, None], len(angle), 1), r * np.cos(angle)], -1)
    points[:, -1] = points[:, 0]
    uvs = np.stack(np.broadcast_arrays(angle[None] * radius, -levels[:, None]), -1)
    body = grid(points, uvs, wrap_columns=True)
    disc = [(1.05 * radius, 0.0), (1.12 * radius, 0.03), (1.12 * radius, 0.10), (1.05 * radius, 0.13)]
    return merge(body, lathe(disc, 48), lathe(disc, 48).moved(y=height - 0.13))
