"""The order of triangles in which solid bodies come before everything open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssil_viewer.scene.model import Scene
from ssil_viewer.scene.solids import solid_triangles


@dataclass(frozen=True)
class SolidOrder:
    """All opaque triangles of a scene, those of solid bodies first.

    Attributes:
        indices: (3 T,) uint32, into the vertices of all instances' primitives in order.
        solid_count: Number of indices, from the first, that belong to solid bodies.
        open_meshes: Names of the meshes with triangles that bound no solid body, masked ones among them.
    """

    indices: np.ndarray
    solid_count: int
    open_meshes: tuple[str, ...]


def solid_order(scene: Scene) -> SolidOrder:
    """Sort the triangles of a scene. Takes about half a second for each million of them, instances aside."""
    opaque = np.array([material.alpha_mode == "opaque" for material in scene.materials], bool)
    drawn = sorted({instance.mesh for instance in scene.instances})
    solid = {}
    for mesh in drawn:
        primitives = scene.meshes[mesh].primitives
        flags = solid_triangles(scene.meshes[mesh], np.array([opaque[p.material] for p in primitives], bool))
        solid[mesh] = np.split(flags, np.cumsum([len(p.indices) for p in primitives])[:-1])
    parts: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    base = 0
    for instance in scene.instances:
        for primitive, flags in zip(scene.meshes[instance.mesh].primitives, solid[instance.mesh]):
            if opaque[primitive.material]:
                corners = (primitive.indices + np.uint32(base)).astype(np.uint32)
                parts[0].append(corners[flags].ravel())
                parts[1].append(corners[~flags].ravel())
            base += len(primitive.positions)
    empty = np.zeros(0, np.uint32)
    names = tuple(scene.meshes[mesh].name for mesh in drawn if not all(flags.all() for flags in solid[mesh]))
    return SolidOrder(np.concatenate([empty, *parts[0], *parts[1]]), sum(map(len, parts[0])), names)
