"""The same picture from more triangles or more lights."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ssil_viewer.scene.model import Light, Primitive, Scene


def with_triangles(scene: Scene, count: int) -> Scene:
    """The scene with about so many triangles: each is cut into equal ones in its own plane.

    Args:
        count: At least the scene's own; the result has n^2 times as many as that, with the whole n that comes nearest.
    """
    cuts = max(1, round(math.sqrt(count / max(scene.triangle_count, 1))))
    if cuts == 1:
        return scene
    meshes = tuple(dataclasses.replace(mesh, primitives=tuple(_cut(p, cuts) for p in mesh.primitives))
                   for mesh in scene.meshes)
    return dataclasses.replace(scene, meshes=meshes)


def _cut(primitive: Primitive, cuts: int) -> Primitive:
    """Each triangle as cuts^2 triangles; attributes are interpolated, directions made unit length again."""
    grid = [(i, j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]
    at = {point: index for index, point in enumerate(grid)}
    corners = [[at[i, j], at[i + 1, j], at[i, j + 1]] for i, j in grid if i + j < cuts]
    corners += [[at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]] for i, j in grid if i + j < cuts - 1]
    weights = np.array([(cuts - i - j, i, j) for i, j in grid], np.float64) / cuts

    def interpolated(values: np.ndarray) -> np.ndarray:
        # In double precision, so that two triangles put the same points on the edge that they share
        shape = values.shape[1:]
        picked = values.reshape(len(values), -1)[primitive.indices].astype(np.float64)      # (T, 3, C)
        return np.einsum("pk,tkc->tpc", weights, picked).reshape(-1, *shape)

    def directions(values: np.ndarray) -> np.ndarray:
        found = interpolated(values)
        found[:, :3] /= np.maximum(np.linalg.norm(found[:, :3], axis=1, keepdims=True), 1e-30)
        return found.astype(np.float32)

    first = np.arange(len(primitive.indices))[:, None, None] * len(grid)
    tangents = None
    if primitive.tangents is not None:
        tangents = directions(primitive.tangents)
        tangents[:, 3] = np.where(tangents[:, 3] < 0.0, -1.0, 1.0)      # a sign
    return dataclasses.replace(
        primitive, positions=interpolated(primitive.positions).astype(np.float32),
        normals=directions(primitive.normals), tangents=tangents,
        texcoords=interpolated(primitive.texcoords).astype(np.float32),
        colors=None if primitive.colors is None else interpolated(primitive.colors).astype(np.float32),
        indices=(np.array(corners)[None] + first).reshape(-1, 3).astype(np.uint32))


def with_lights(lights: tuple[Light, ...], count: int) -> tuple[Light, ...]:
    """The lights as about so many: each as several in the same place that share its intensity."""
    each = max(1, count // max(len(lights), 1))
    return tuple(dataclasses.replace(light, intensity=light.intensity / each) for light in lights for _ in range(each))
