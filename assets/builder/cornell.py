"""`cornell`: the box in which colours bleed, lit by one point light, for comparison with path tracers.

The inside is that of the Cornell box as measured (5.5 m instead of 55 cm), made right-angled: 5.528 wide,
5.488 high, 5.592 deep. Every surface is exactly Lambertian. The open front is at z = 0, the back at
z = -5.592, x runs from -2.764 (red) to 2.764 (green), the floor is y = 0.
"""

from __future__ import annotations

from .geometry import Surface, box
from .glb import SceneBuilder

WIDTH, HEIGHT, DEPTH = 5.528, 5.488, 5.592
WALL = 0.2
"""Thickness of the walls, metres: closed slabs, so that shadow maps and solid voxels see them."""

WHITE = (0.73, 0.73, 0.73)
RED = (0.63, 0.065, 0.05)
GREEN = (0.14, 0.45, 0.091)


def build() -> SceneBuilder:
    """The scene, ready to be written."""
    scene = SceneBuilder()
    white = scene.material("white", WHITE, specular=0.0)
    red = scene.material("red", RED, specular=0.0)
    green = scene.material("green", GREEN, specular=0.0)
    x, w = WIDTH / 2, WALL
    # The side walls stand between floor and ceiling, and the back wall between all four, so that no two
    # slabs share space: solid voxelisation counts every surface once.
    slabs: dict[str, tuple] = {
        "floor": (white, box((-x - w, -w, -DEPTH - w), (x + w, 0, 0))),
        "ceiling": (white, box((-x - w, HEIGHT, -DEPTH - w), (x + w, HEIGHT + w, 0))),
        "back wall": (white, box((-x - w, 0, -DEPTH - w), (x + w, HEIGHT, -DEPTH))),
        "left wall": (red, box((-x - w, 0, -DEPTH), (-x, HEIGHT, 0))),
        "right wall": (green, box((x, 0, -DEPTH), (x + w, HEIGHT, 0))),
    }
    for name, part in slabs.items():
        scene.place(name, scene.mesh(name, part))
    scene.place("short block", scene.mesh("short block", (white, _block(1.65))), (0.93, 0.0, -1.69), turn=-17.0)
    scene.place("tall block", scene.mesh("tall block", (white, _block(3.30))), (-0.92, 0.0, -3.51), turn=18.0)
    # A point has no size: a metre below the ceiling its hot spot there stays within a tone map's reach.
    scene.light("lamp", "point", 26.0, color=(1.0, 0.9, 0.75), position=(0.0, HEIGHT - 1.0, -2.8))
    # The classic viewpoint is 8 m before the opening, whose height the picture just holds.
    scene.camera("front", (0.0, HEIGHT / 2, 8.0), (0.0, HEIGHT / 2, -DEPTH), fov=37.6)
    return scene


def _block(height: float) -> Surface:
    """A block of 1.65 x 1.65 m that stands on y = 0."""
    return box((-0.825, 0.0, -0.825), (0.825, height, 0.825))
