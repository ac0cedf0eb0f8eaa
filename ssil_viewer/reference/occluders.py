"""What blocks light in a scene, for reference R2: its triangles, through Embree."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.scene.model import Camera, Image, Material, Primitive, Scene, TextureRef

LIFT = 3e-4
"""Of the view depth: a third of a pixel at 720 lines. Rasterizers place vertices to 1/256 of a pixel, which moves a
surface seen at 89 degrees along the view ray by two thirds of this."""

MOST_HOLES = 64
"""Holes on one ray; what is behind so many counts as seen."""


class Occluders:
    """The triangles of a scene in a camera's view space, so that single precision is spent around the camera.

    They block from both sides. Masked and blended ones have holes where the renderer leaves them: where alpha is below
    the cutoff, here at the nearest texel of the texture itself.
    """

    def __init__(self, scene: Scene, camera: Camera) -> None:
        eye = np.asarray(camera.eye, np.float64)
        view_from_world = look_along(eye, np.asarray(camera.target, np.float64) - eye, np.asarray(camera.up))
        solid, masked = [], []
        self._masks: list[_Mask] = []
        for instance in scene.instances:
            view_from_object = view_from_world @ instance.world_from_object
            for primitive in scene.meshes[instance.mesh].primitives:
                points = primitive.positions @ view_from_object[:3, :3].T + view_from_object[:3, 3]
                triangles = points[primitive.indices].astype(np.float32)
                material = scene.materials[primitive.material]
                if material.alpha_mode == "opaque":
                    solid.append(triangles)
                else:
                    masked.append(triangles)
                    self._masks.append(_Mask(primitive, material, scene.images))
        self._solid, self._masked = _tree(solid), _tree(masked)
        self._first = np.cumsum([0, *(len(triangles) for triangles in masked)])

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(N,) bool: whether something lies between two points that the camera sees, each (N, 3) in view space."""
        start, end = start * (1 - LIFT), end * (1 - LIFT)
        length = np.linalg.norm(end - start, axis=-1)
        along = ((end - start) / np.maximum(length, 1e-12)[:, None]).astype(np.float32)
        blocked = np.zeros(len(start), bool)
        if self._solid is not None:
            blocked = self._solid[0].run(start.astype(np.float32), along, dists=length.astype(np.float32),
                                         query="OCCLUDED") != -1
        if self._masked is None:
            return blocked
        left, passed = np.flatnonzero(~blocked), np.zeros(len(start))
        for _ in range(MOST_HOLES):
            origin = (start[left] + along[left] * passed[left, None]).astype(np.float32)
            hit = self._masked[0].run(origin, along[left], output=True,
                                      dists=np.maximum(length[left] - passed[left], 0).astype(np.float32))
            met = hit["primID"] >= 0
            left = left[met]
            if not len(left):
                break
            hole = self._holes(hit["primID"][met], hit["u"][met], hit["v"][met])
            blocked[left[~hole]] = True
            # On behind the hole, by as much as the ends are lifted
            passed[left] += hit["tfar"][met] + LIFT * 0.1 * length[left]
            left = left[hole]
        return blocked

    def _holes(self, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(N,) bool: whether masked triangles have a hole at barycentric coordinates."""
        at = np.searchsorted(self._first, triangle, side="right") - 1
        weights = np.stack([1 - u - v, u, v], -1).astype(np.float64)
        hole = np.zeros(len(triangle), bool)
        for mask in np.unique(at):
            here = at == mask
            hole[here] = self._masks[mask].is_hole(triangle[here] - self._first[mask], weights[here])
        return hole


class _Mask:
    """Alpha over the triangles of a primitive."""

    def __init__(self, primitive: Primitive, material: Material, images: tuple[Image, ...]) -> None:
        self._cutoff = material.alpha_cutoff
        colors = primitive.colors
        alpha = np.ones(len(primitive.positions)) if colors is None else colors[:, 3].astype(np.float64)
        self._alpha = material.base_color[3] * alpha[primitive.indices]
        self._ref = material.base_color_texture
        if self._ref is not None:
            self._pixels = images[self._ref.image].pixels[..., 3]
            self._uv = _transformed(primitive.texcoords[:, self._ref.texcoord], self._ref)[primitive.indices]

    def is_hole(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """For triangles (N,) and barycentric weights (N, 3)."""
        alpha = (self._alpha[triangle] * weights).sum(-1)
        if self._ref is not None:
            u, v = (self._uv[triangle] * weights[..., None]).sum(1).T
            height, width = self._pixels.shape
            column = _wrapped(np.floor(u * width).astype(int), width, self._ref.wrap_u)
            row = _wrapped(np.floor(v * height).astype(int), height, self._ref.wrap_v)
            alpha = alpha * self._pixels[row, column] / 255.0
        return alpha < self._cutoff


def _transformed(uv: np.ndarray, ref: TextureRef) -> np.ndarray:
    """Texture coordinates after KHR_texture_transform."""
    c, s = np.cos(ref.rotation), np.sin(ref.rotation)
    return (uv.astype(np.float64) * ref.scale) @ np.array([[c, s], [-s, c]]).T + ref.offset


def _wrapped(texel: np.ndarray, count: int, wrap: str) -> np.ndarray:
    if wrap == "clamp":
        return np.clip(texel, 0, count - 1)
    if wrap == "mirror":
        return np.minimum(texel % (2 * count), 2 * count - 1 - texel % (2 * count))
    return texel % count


def _tree(triangles: list[np.ndarray]) -> tuple[EmbreeScene, TriangleMesh] | None:
    """Embree's scene, and the mesh that must live as long."""
    if not triangles:
        return None
    scene = EmbreeScene(robust=True)
    return scene, TriangleMesh(scene, np.concatenate(triangles))
