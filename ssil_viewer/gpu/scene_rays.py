"""What passes that trace rays know of the scene: its triangles and, for unseen light, its surfels, as textures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.memory import allocating
from ssil_viewer.gpu.scene_buffers import float_table
from ssil_viewer.gpu.targets import SURFEL_SIDE
from ssil_viewer.gpu.triangle_tables import GpuTriangles, TriangleTables, check_triangle_count
from ssil_viewer.scene.model import Scene
from ssil_viewer.scene.surfels import Surfels, spread_surfels, triangle_colors

NEAR_SPACINGS = 20.0
"""Distance in spacings of surfels within which rays of random directions look for light instead. From 3 on, surfels are
close enough together to stand for what is there; but of what is near, few are drawn, and each brings much: at 3 walls
behind a sunlit curtain were full of blotches, at 20 they are even."""

ADVICE = "give --unseen-samples 0 --visibility-rays 0 --no-shadow-rays"
_FIELDS = ("position", "normal", "albedo", "emission")


@dataclass(frozen=True)
class RayTables:
    """What the textures of `SceneRays` hold. Made without OpenGL, so that another thread can do it: seconds for the
    250,000 triangles of the built-in atrium.

    Attributes:
        scene: Whose triangles these are, as they stood then.
        surfels: None where unseen light is not asked for.
        node_count, masked, has_surfels, extent, near: As of `SceneRays`.
    """

    scene: Scene
    triangles: TriangleTables
    surfels: Surfels | None

    @property
    def node_count(self) -> int:
        return self.triangles.node_count

    @property
    def masked(self) -> bool:
        return self.triangles.masked

    @property
    def has_surfels(self) -> bool:
        return self.surfels is not None

    @cached_property
    def extent(self) -> float:
        low, high = self.scene.bounds()
        return float(np.linalg.norm(high - low))

    @cached_property
    def near(self) -> float:
        if self.surfels is None or not len(self.surfels.area):
            return 0.0
        return NEAR_SPACINGS * math.sqrt(float(np.median(self.surfels.area)))

    @staticmethod
    def of(scene: Scene, origin: np.ndarray, surfels: bool) -> RayTables:
        """The tables of a scene.

        Args:
            origin: (3,) the world position that shaders take for zero.
            surfels: Whether to make these, and the triangles' colours, which unseen light alone needs.

        Raises:
            UserError: The triangles are too many, or there is no memory for them.
        """
        try:
            check_triangle_count(scene)
            spread = spread_surfels(scene, origin, SURFEL_SIDE**2) if surfels else None
            colors = triangle_colors(scene) if surfels else None
            return RayTables(scene, TriangleTables.of(scene, origin, colors), spread)
        except UserError as error:
            raise UserError(f"rays: {error.what}", error.where, ADVICE) from error
        except MemoryError as error:
            raise UserError("rays: the triangles that rays meet cannot be allocated (out of memory)", scene.name,
                            ADVICE) from error


class SceneRays:
    """Triangles and surfels of a scene on the GPU, as they stood when their tables were made.

    Attributes:
        textures: By their names in shaders, without "texture_": `surfel_position` (the area in alpha), `surfel_normal`,
            `surfel_albedo` and `surfel_emission`, SURFEL_SIDE texels a side in Z-order; and those of `GpuTriangles`.
        node_count, masked: Of the triangles' tree.
        has_surfels: Whether there are such.
        extent: Metres, the diagonal of the scene's box: so far away can anything be.
        near: Of unseen light, metres. What is closer to a receiver than this is found by rays of random directions:
            surfels are too far apart to stand for it.

    Raises:
        UserError: They do not fit into memory; nothing is allocated then.
    """

    def __init__(self, context: moderngl.Context, tables: RayTables) -> None:
        try:
            self._triangles = GpuTriangles(context, tables.triangles)
        except UserError as error:
            raise UserError(f"rays: {error.what}", error.where, ADVICE) from error
        self.node_count, self.masked, self.has_surfels = tables.node_count, tables.masked, tables.has_surfels
        self.extent, self.near = tables.extent, tables.near
        self._own: dict[str, moderngl.Texture] = {}
        try:
            if tables.surfels is not None:
                self._upload(context, tables.scene, tables.surfels)
        except BaseException:
            self.release()
            raise
        self.textures = self._own | self._triangles.textures

    def _upload(self, context: moderngl.Context, scene: Scene, surfels: Surfels) -> None:
        with allocating(context, "the surfels of unseen light", scene.name, ADVICE):
            for name in _FIELDS:
                texels = np.zeros((SURFEL_SIDE**2, 4), np.float32)
                texels[:len(surfels.area), :3] = getattr(surfels, name)
                if name == "position":
                    texels[:len(surfels.area), 3] = surfels.area
                self._own[f"surfel_{name}"] = float_table(context, SURFEL_SIDE, SURFEL_SIDE)
                self._own[f"surfel_{name}"].write(_z_ordered(texels).tobytes())

    def release(self) -> None:
        """Free all GPU memory."""
        for texture in self._own.values():
            texture.release()
        self._own.clear()
        self._triangles.release()


def _z_ordered(texels: np.ndarray) -> np.ndarray:
    """(SIDE^2, C) along the Z-order curve to (SIDE, SIDE, C), so that a square of texels is a run of surfels."""
    bits = SURFEL_SIDE.bit_length() - 1
    index = np.arange(SURFEL_SIDE**2)
    column, row = np.zeros_like(index), np.zeros_like(index)
    for bit in range(bits):
        column |= (index >> (2 * bit) & 1) << bit
        row |= (index >> (2 * bit + 1) & 1) << bit
    placed = np.zeros((SURFEL_SIDE, SURFEL_SIDE, texels.shape[1]), texels.dtype)
    placed[row, column] = texels
    return placed
