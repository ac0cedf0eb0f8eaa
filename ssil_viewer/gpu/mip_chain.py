"""Mipmaps of pictures by NumPy, for software OpenGL, which takes twice as long for them and compiles programs first."""

from __future__ import annotations

import functools

import numpy as np


def has_mip_chain(width: int, height: int) -> bool:
    """Whether `mip_chain` can halve such a picture: its sides are powers of two."""
    return width & (width - 1) == 0 and height & (height - 1) == 0


def mip_chain(pixels: np.ndarray, srgb: bool) -> list[np.ndarray]:
    """All levels of a picture, each texel the mean of the four, or at one texel of width or height two, below it.

    Args:
        pixels: (H, W, 4) uint8, sides powers of two.
        srgb: RGB is sRGB-encoded; the mean is of light.

    Returns:
        The picture itself, then (H/2, W/2, 4) uint8 and so on to (1, 1, 4).
    """
    decode, encode = _tables()
    levels = [pixels]
    # 16 bits hold light finely enough for every 8-bit value to come back
    linear = decode[pixels] if srgb else pixels * np.uint16(257)
    if srgb:
        linear[..., 3] = pixels[..., 3] * np.uint16(257)
    while max(linear.shape[:2]) > 1:
        total = linear.astype(np.uint32)
        if total.shape[0] > 1:
            total = total[0::2] + total[1::2]
        if total.shape[1] > 1:
            total = total[:, 0::2] + total[:, 1::2]
        count = linear.shape[0] * linear.shape[1] // (total.shape[0] * total.shape[1])
        linear = ((total + count // 2) // count).astype(np.uint16)
        level = ((linear.astype(np.uint32) + 128) // 257).astype(np.uint8)
        if srgb:
            level[..., :3] = encode[linear[..., :3]]
        levels.append(level)
    return levels


@functools.cache
def _tables() -> tuple[np.ndarray, np.ndarray]:
    """sRGB's 256 values as 16-bit light, and 65,536 values of light as sRGB (IEC 61966-2-1)."""
    encoded, light = np.arange(256) / 255, np.arange(65536) / 65535
    decode = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    encode = np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(65535 * decode).astype(np.uint16), np.round(255 * encode).astype(np.uint8)
