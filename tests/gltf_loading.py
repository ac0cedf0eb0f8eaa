"""Loads what `GltfBuilder` wrote, and picks out of the scene what a test looks at."""

from __future__ import annotations

import numpy as np

from ssil_viewer.scene import Scene, load_scene
from ssil_viewer.scene.model import Material
from tests.gltf_builder import GltfBuilder

SUN = "default sun"


def load(builder: GltfBuilder, folder, name: str = "scene.glb") -> Scene:
    return load_scene(builder.write(folder, name))


def only_primitive(scene: Scene):
    (mesh,) = scene.meshes
    (primitive,) = mesh.primitives
    return primitive


def warnings(scene: Scene) -> list[str]:
    """All warnings but that of the default sun."""
    return [w for w in scene.warnings if SUN not in w]


def world_positions(scene: Scene) -> np.ndarray:
    parts = []
    for instance in scene.instances:
        for primitive in scene.meshes[instance.mesh].primitives:
            matrix = instance.world_from_object
            parts.append(primitive.positions @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(parts)


def material_of(tmp_path, builder: GltfBuilder, index: int | None) -> tuple[Material, Scene]:
    extra = {} if index is None else {"material": index}
    builder.node(mesh=builder.mesh(builder.primitive(**extra)))
    scene = load(builder, tmp_path)
    return scene.materials[only_primitive(scene).material], scene
