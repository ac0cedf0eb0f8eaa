"""Texture lookups on the CPU: the texel at a place, without filtering."""

from __future__ import annotations

import numpy as np

from ssil_viewer.scene.colors import srgb_to_linear
from ssil_viewer.scene.geometry import transformed_texcoords
from ssil_viewer.scene.model import Image, TextureRef, Wrap


def wrapped(texel: np.ndarray, count: int, wrap: Wrap) -> np.ndarray:
    """Whole texel numbers brought into 0 to count - 1."""
    if wrap == "clamp":
        return np.clip(texel, 0, count - 1)
    if wrap == "mirror":
        return np.minimum(texel % (2 * count), 2 * count - 1 - texel % (2 * count))
    return texel % count


def nearest_texels(pixels: np.ndarray, uv: np.ndarray, wraps: tuple[Wrap, Wrap]) -> np.ndarray:
    """The texels (N, ...) of an image (h, w, ...) at texture coordinates (N, 2) that are transformed already."""
    height, width = pixels.shape[:2]
    column, row = np.floor(uv * (width, height)).astype(int).T
    return pixels[wrapped(row, height, wraps[1]), wrapped(column, width, wraps[0])]


def texels_of(images: tuple[Image, ...], ref: TextureRef, uv: np.ndarray) -> np.ndarray:
    """The stored texels (N, 4) uint8 that a material's texture has at texture coordinates (N, 2, 2), both sets."""
    return nearest_texels(images[ref.image].pixels, transformed_texcoords(uv, ref), (ref.wrap_u, ref.wrap_v))


def linear_from_srgb(pixels: np.ndarray) -> np.ndarray:
    """Linear float32 of sRGB-encoded bytes."""
    return srgb_to_linear(np.arange(256, dtype=np.float32) / 255).astype(np.float32)[pixels]
