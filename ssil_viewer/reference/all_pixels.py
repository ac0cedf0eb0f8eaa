"""Reference R1: the irradiance as the plain sum over all pixels, in float64 on the CPU.

The sum uses the gather's estimator with every texel of one level as a sender and nothing between sender and receiver.
`compare` takes the image's own pixels, which stand for the surface that they show: what differs from it is noise,
rings, coarse levels, their mipmaps and the upsampling. With texels of the starting level as senders
(`Senders.of_texels`) it is what the gather itself would come to without noise and with that level alone.

Pyramid levels are ceil(size / 2^l) wide: texel x of level l covers the level-0 pixels [x 2^l, (x + 1) 2^l) and its
centre lies at (x + 1/2) 2^l level-0 pixels, beyond the image's edge where an odd size leaves the last texel of a row
half empty. Dividing the image by the level's own width instead would move every sender by up to half a texel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Iterator

import numpy as np

from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera

LEAST_FACING = 0.01
"""The gather holds the cosine between a sender's normal and the direction to the camera above this."""


_ENOUGH, _NEAR = 60_000, 96     # senders; pixels: see Senders.for_block


@dataclass(frozen=True)
class Surfaces:
    """The visible surfaces of one pyramid level in view space, float64.

    Attributes:
        position: (H, W, 3) metres.
        normal: (H, W, 3) unit length.
        area: (H, W) square metres of surface that a texel stands for.
        visible: (H, W) bool, False on background.
    """

    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    visible: np.ndarray


SAME_NORMAL = 0.9998
"""Cosine from which on the triangle's normal, which the image keeps to a degree, is taken for the shading normal, which
it keeps to a tenth of that: 1.15 degrees. shaders/reference/sum.glsl has the same."""


def _unit(vectors: np.ndarray) -> np.ndarray:
    vectors = vectors.astype(np.float64)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def read_surfaces(renderer: Renderer, camera: Camera, level: int = 0, triangles: bool = False) -> Surfaces:
    """What the last frame of `renderer` holds at one level.

    Args:
        triangles: Level 0 alone: with the normals of the triangles themselves, as senders need them. A normal that is
            interpolated or mapped makes a pixel at a grazing angle stand for up to a hundred times its surface: Sponza
            sent 21 % too much.
    """
    depth = renderer.read("view_depth", level).astype(np.float64)
    normal = _unit(renderer.read("normal", level))
    if triangles:
        of_triangle = _unit(renderer.read("triangle_normal", level))
        other = (of_triangle * normal).sum(-1) < SAME_NORMAL
        normal[other] = of_triangle[other]
    height, width = depth.shape
    image_width, image_height = renderer.size
    tan_y = np.tan(camera.vertical_fov / 2)
    tan_x = tan_y * image_width / image_height
    x = ((np.arange(width) + 0.5) * 2**level / image_width * 2 - 1) * tan_x
    # Row 0 of an array is the top, row 0 of a texture the bottom: the hanging texel is at the top of the image.
    y = ((height - 1 - np.arange(height) + 0.5) * 2**level / image_height * 2 - 1) * tan_y
    ray = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)
    position = ray * depth[..., None]
    pixel_area = 4 * tan_x * tan_y / (image_width * image_height) * 4**level
    facing = np.maximum(-(normal * position).sum(-1), LEAST_FACING * np.linalg.norm(position, axis=-1))
    area = pixel_area * depth**3 / np.maximum(facing, 1e-30)
    return Surfaces(position, normal, area, depth > 0)


@dataclass(frozen=True)
class Senders:
    """What sends light in R1 and R2.

    Attributes:
        surfaces: Of one level.
        radiance: (H, W, 3) of that level.
        pixels: They are the image's own pixels.
    """

    surfaces: Surfaces
    radiance: np.ndarray
    pixels: bool

    @staticmethod
    def of_pixels(renderer: Renderer, camera: Camera) -> Senders:
        """The image's own pixels: as exact as the image is."""
        return Senders(read_surfaces(renderer, camera, triangles=True), renderer.read("radiance"), True)

    @staticmethod
    def of_texels(renderer: Renderer, camera: Camera, level: int) -> Senders:
        """The texels of a level of the pyramid, as the gather sees them."""
        return Senders(read_surfaces(renderer, camera, level), renderer.read("radiance", level), False)

    def for_block(self, rows: np.ndarray, columns: np.ndarray, seed: int) -> np.ndarray:
        """(H, W, 3): the radiance with which they send to a block of pixels.

        Where many pixels shine, one of each square of them is drawn far from the block, and stands for all of it:
        unbiased, and so many are left that the noise is below half a percent.
        """
        side = max(1, round((shining(self.surfaces, self.radiance).sum() / _ENOUGH)**0.5)) if self.pixels else 1
        if side == 1:
            return self.radiance
        height, width = self.radiance.shape[:2]
        cells = -(-height // side), -(-width // side)
        drawn = np.random.default_rng(seed).integers(0, side, (2, *cells))
        y, x = np.arange(cells[0])[:, None] * side + drawn[0], np.arange(cells[1]) * side + drawn[1]
        inside = (y < height) & (x < width)
        weight = np.zeros((height, width))
        weight[y[inside], x[inside]] = side**2
        near = (slice(max(int(of.min()) - _NEAR, 0), int(of.max()) + _NEAR + 1) for of in (rows, columns))
        weight[tuple(near)] = 1.0
        return self.radiance * weight[..., None]


def shining(senders: Surfaces, radiance: np.ndarray) -> np.ndarray:
    """(H, W) bool: the texels that send any light."""
    return senders.visible & (radiance.max(-1) > 0)


def transport(senders: Surfaces, chosen: np.ndarray, position: np.ndarray, normal: np.ndarray,
              form_factor: str = "disc") -> Iterator[tuple[slice, np.ndarray]]:
    """Irradiance for a radiance of 1, pi cos F, unoccluded.

    Args:
        chosen: Index of M senders into (H, W) arrays: a mask or rows and columns.
        position, normal: (N, 3) of the receivers, view space.
        form_factor: "disc": F = R^2 / (r^2 + R^2), "point": R^2 / r^2, with R^2 = cos' dA / pi.

    Yields:
        Some of the receivers and their (n, M) float64, in steradian.
    """
    q, m, area = senders.position[chosen], senders.normal[chosen], senders.area[chosen]
    own = (q * m).sum(-1)
    squared = (q * q).sum(-1)
    chunk = max(1, 100_000 // max(len(q), 1))     # what fits a core's cache: a third of the time
    for start in range(0, len(position), chunk):
        part = slice(start, start + chunk)
        p, n = position[part], normal[part]
        distance2 = np.maximum((p * p).sum(-1)[:, None] + squared - 2 * p @ q.T, 1e-18)
        inverse = 1 / np.sqrt(distance2)
        receiver_cos = np.maximum(n @ q.T - (n * p).sum(-1)[:, None], 0) * inverse
        disc = np.maximum(p @ m.T - own, 0) * inverse * area / np.pi
        factor = disc / (distance2 + disc) if form_factor == "disc" else disc / distance2
        yield part, np.pi * receiver_cos * factor


def irradiance(senders: Surfaces, radiance: np.ndarray, position: np.ndarray, normal: np.ndarray,
               form_factor: str = "disc") -> np.ndarray:
    """Irradiance at receivers from all visible senders, E = sum of pi L cos F, unoccluded; see `transport`.

    Args:
        radiance: (H, W, 3) of the senders' level.

    Returns:
        (N, 3) float64.
    """
    chosen = shining(senders, radiance)
    light = radiance[chosen].astype(np.float64)
    result = np.zeros((len(position), 3))
    for part, factors in transport(senders, chosen, position, normal, form_factor):
        result[part] = factors @ light
    return result


def random_blocks(visible: np.ndarray, count: int, side: int = 8, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, each (B, side, side), of `count` random aligned blocks of pixels; those that see background
    are left out. None of an image that is smaller than one."""
    height, width = visible.shape
    if min(height, width) < side:
        return (np.zeros((0, side, side), int),) * 2
    rng = np.random.default_rng(seed)
    top = rng.integers(0, height // side, count) * side
    left = rng.integers(0, width // side, count) * side
    rows = top[:, None, None] + np.arange(side)[None, :, None] + np.zeros((1, 1, side), int)
    columns = left[:, None, None] + np.arange(side)[None, None, :] + np.zeros((1, side, 1), int)
    whole = visible[rows, columns].all((1, 2))
    return rows[whole], columns[whole]
