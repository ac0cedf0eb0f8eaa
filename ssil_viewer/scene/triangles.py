"""The triangles of a scene that block light, and the holes of masked ones, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssil_viewer.scene.geometry import transformed_texcoords
from ssil_viewer.scene.model import Image, Material, Primitive, Scene
from ssil_viewer.scene.texels import nearest_texels

LIFT = 3e-4
"""Of the view depth, by which both ends of a ray stand off their surfaces towards the camera: a third of a pixel at 720
lines. Rasterizers place vertices to 1/256 of a pixel, which moves a surface seen at 89 degrees along the view ray by
two thirds of this."""

MOST_HOLES = 64
"""Holes on one ray; what is behind so many counts as seen."""


class Mask:
    """Alpha over the triangles of a primitive; there is a hole where it is below the cutoff.

    Attributes:
        cutoff: Of the material.
        alpha: (T, 3) float64 at the triangles' corners, without the texture's.
        pixels: (h, w) uint8, alpha of the texture, or None.
        uv: (T, 3, 2) float64, texture coordinates at the corners, transformed; None without a texture.
        wraps: How the texture goes on in u and in v: "repeat", "clamp" or "mirror".

    Args:
        turn: -1 takes each triangle's corners in the opposite order.
    """

    def __init__(self, primitive: Primitive, material: Material, images: tuple[Image, ...], turn: int = 1) -> None:
        indices = primitive.indices[:, ::turn]
        self.cutoff = material.alpha_cutoff
        colors = primitive.colors
        alpha = np.ones(len(primitive.positions)) if colors is None else colors[:, 3].astype(np.float64)
        self.alpha = material.base_color[3] * alpha[indices]
        self.pixels: np.ndarray | None = None
        self.uv: np.ndarray | None = None
        self.wraps = ("repeat", "repeat")
        if (ref := material.base_color_texture) is not None:
            self.pixels = images[ref.image].pixels[..., 3]
            self.uv = transformed_texcoords(primitive.texcoords, ref)[indices]
            self.wraps = (ref.wrap_u, ref.wrap_v)

    def is_hole(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """For triangles (N,) and barycentric weights (N, 3)."""
        alpha = (self.alpha[triangle] * weights).sum(-1)
        if self.pixels is not None:
            uv = (self.uv[triangle] * weights[..., None]).sum(1)
            alpha = alpha * nearest_texels(self.pixels, uv, self.wraps) / 255.0
        return alpha < self.cutoff


@dataclass(frozen=True)
class SceneTriangles:
    """All triangles of all instances. They block from both sides; fronts are counter-clockwise.

    Attributes:
        solid: (N, 3, 3) float32 corners.
        masked: (M, 3, 3) float32, those with holes where the renderer leaves them: where alpha is below the cutoff,
            here at the nearest texel of the texture itself.
        masks: One for each primitive of an instance that is in `masked`.
        first: (len(masks) + 1,) the first triangle of each mask in `masked`.
    """

    solid: np.ndarray
    masked: np.ndarray
    masks: tuple[Mask, ...]
    first: np.ndarray

    @staticmethod
    def of(scene: Scene, space_from_world: np.ndarray) -> SceneTriangles:
        """The triangles of a scene in a space, given the (4, 4) transform into it."""
        solid: list[np.ndarray] = []
        masked: list[np.ndarray] = []
        masks: list[Mask] = []
        for instance in scene.instances:
            transform = space_from_world @ instance.world_from_object
            turn = -1 if np.linalg.det(transform[:3, :3]) < 0 else 1    # mirrored front faces stay front faces
            for primitive in scene.meshes[instance.mesh].primitives:
                points = primitive.positions @ transform[:3, :3].T + transform[:3, 3]
                triangles = points[primitive.indices[:, ::turn]].astype(np.float32)
                material = scene.materials[primitive.material]
                if material.alpha_mode == "opaque":
                    solid.append(triangles)
                else:
                    masked.append(triangles)
                    masks.append(Mask(primitive, material, scene.images, turn))
        none = np.zeros((0, 3, 3), np.float32)
        return SceneTriangles(np.concatenate([none, *solid]), np.concatenate([none, *masked]), tuple(masks),
                              np.cumsum([0, *(len(triangles) for triangles in masked)]))
