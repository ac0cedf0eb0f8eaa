"""`arch`: a room whose right wall alone is lit, to see indirect shadows.

After the visibility picture of Soler et al. 2010. A spot light before the room lights nothing but the warm
right wall; the light that comes back from it falls on a cube and on a free-standing arch, which throw
soft shadows to the left. Every surface is exactly Lambertian. The room is 6 x 3.6 x 5 m inside, open
towards +Z; x runs from -3 to 3, the floor is y = 0, the back wall z = -5.
"""

from __future__ import annotations

import numpy as np

from .geometry import Surface, box, extrude
from .glb import SceneBuilder

WALL = 0.2


def build() -> SceneBuilder:
    """The scene, ready to be written."""
    scene = SceneBuilder()
    pale = scene.material("pale plaster", (0.62, 0.61, 0.58), specular=0.0)
    floor = scene.material("pale floor", (0.55, 0.55, 0.55), specular=0.0)
    warm = scene.material("warm wall", (0.75, 0.46, 0.24), specular=0.0)
    stone = scene.material("white stone", (0.72, 0.72, 0.70), specular=0.0)
    slabs: dict[str, tuple] = {
        "floor": (floor, box((-3.2, -WALL, -5.2), (3.2, 0.0, 0.0))),
        "ceiling": (pale, box((-3.2, 3.6, -5.2), (3.2, 3.6 + WALL, 0.0))),
        "back wall": (pale, box((-3.2, 0.0, -5.2), (3.2, 3.6, -5.0))),
        "left wall": (pale, box((-3.2, 0.0, -5.0), (-3.0, 3.6, 0.0))),
        "right wall": (warm, box((3.0, 0.0, -5.0), (3.2, 3.6, 0.0))),
    }
    for name, part in slabs.items():
        scene.place(name, scene.mesh(name, part))
    scene.place("arch", scene.mesh("arch", (stone, free_arch())), (0.45, 0.0, -3.3), turn=58.0)
    cube = box((-0.45, 0.0, -0.45), (0.45, 0.9, 0.45))
    scene.place("cube", scene.mesh("cube", (stone, cube)), (0.75, 0.0, -1.35), turn=24.0)
    # From the front left, over the cube and past the arch: the cone ends within the right wall.
    scene.light(
        "spot", "spot", 900.0, (1.0, 0.95, 0.85), position=(-2.0, 3.1, 3.5), direction=(5.0, -1.3, -5.5), cone=(6, 11.8)
    )
    scene.camera("front", (-0.15, 1.9, 4.6), (-0.15, 1.5, -2.5), fov=37.0)
    return scene


def free_arch(span: float = 1.2, pier: float = 0.36, spring: float = 1.3, depth: float = 0.5) -> Surface:
    """A round arch on two piers, one closed solid on y = 0, its passage along z.

    Args:
        span: Clear width, metres.
        pier: Width of each pier.
        spring: Height where the curve begins.
        depth: Extent along the passage.
    """
    inner, outer = span / 2, span / 2 + pier
    turn = np.linspace(0.0, np.pi, 33)
    outline = [(inner, 0.0), (outer, 0.0)]
    outline += [(outer * np.cos(a), spring + outer * np.sin(a)) for a in turn]
    outline += [(-outer, 0.0), (-inner, 0.0)]
    outline += [(inner * np.cos(a), spring + inner * np.sin(a)) for a in turn[::-1]]
    return extrude(outline, depth).moved(z=-depth / 2)
