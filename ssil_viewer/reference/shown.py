"""Which points of a scene an image shows: what one layer of the screen can know of the surfaces that the camera sees.

That nothing lies between a point and the camera is not enough. The sunlit top of a ledge at the height of the eye is in
plain sight, edge-on, a thirtieth of a pixel high, and sends a wall right above it most of its light; but no pixel shows
it. What a pixel shows it stands for, as far as its neighbours: a point is shown if one of the pixels around it lies on
the point's plane and faces the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:       # Mitsuba's process needs nothing of OpenGL
    from ssil_viewer.reference.all_pixels import Surfaces

# As in shaders/lib/unseen.glsl. How far pixels may be off the plane: a share of the depth, or as many pixels if that is
# more; the least cosine between two normals that face the same way.
SHOWN_REACH, SHOWN_PIXELS, SHOWN_FACING = 3e-3, 1.5, 0.5
_AROUND = (0, 0), *((x, y) for y in (-1, 0, 1) for x in (-1, 0, 1) if x or y)


@dataclass(frozen=True, eq=False)
class ShownSurfaces:
    """What an image shows, in view space.

    Attributes:
        position: (H, W, 3) float32, metres.
        normal: (H, W, 3) float32 of the triangles, towards the camera; 0 on background.
        tangents: Of half the fields of view, horizontal and vertical.
    """

    position: np.ndarray
    normal: np.ndarray
    tangents: tuple[float, float]

    @staticmethod
    def of(surfaces: Surfaces, tangents: tuple[float, float]) -> ShownSurfaces:
        """Of the image's pixels, with the normals of their triangles (`read_surfaces(..., triangles=True)`)."""
        normal = np.where(surfaces.visible[..., None], surfaces.normal, 0.0)
        return ShownSurfaces(surfaces.position.astype(np.float32), normal.astype(np.float32), tangents)

    def shows(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """(N,) bool: whether the image shows points that nothing hides from the camera.

        Args:
            position, normal: (N, 3) in view space, metres; the normal of the triangle, to either side.
        """
        height, width = self.position.shape[:2]
        reach = max(SHOWN_REACH, SHOWN_PIXELS * 2 * self.tangents[1] / height)
        depth = -position[:, 2]
        shown = np.zeros(len(position), bool)
        left = np.flatnonzero(depth > 0)
        at = position[left, :2] / depth[left, None] / self.tangents
        column, row = (at[:, 0] * 0.5 + 0.5) * width, (0.5 - at[:, 1] * 0.5) * height
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        left, column, row = left[inside], column[inside].astype(int), row[inside].astype(int)
        for x, y in _AROUND:
            pixel = np.clip(row + y, 0, height - 1), np.clip(column + x, 0, width - 1)
            found = self.normal[pixel]
            n = normal[left]
            off = np.abs(((self.position[pixel] - position[left]) * n).sum(-1))
            here = (off < reach * depth[left]) & (np.abs((found * n).sum(-1)) > SHOWN_FACING)
            shown[left[here]] = True
            left, column, row = left[~here], column[~here], row[~here]
        return shown
