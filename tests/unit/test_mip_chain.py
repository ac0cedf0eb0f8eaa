"""Mipmaps made by NumPy: means of light, and every level of what OpenGL expects."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.gpu.mip_chain import has_mip_chain, mip_chain


def decoded(values: np.ndarray) -> np.ndarray:
    """sRGB to light, by the formula of IEC 61966-2-1."""
    share = values / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("shape", [(8, 8), (1, 16), (16, 2), (1, 1), (64, 32)])
@pytest.mark.parametrize("srgb", [True, False])
def test_every_level_is_the_mean_of_the_picture_below(shape, srgb):
    pixels = np.random.default_rng(3).integers(0, 256, (*shape, 4), np.uint8)
    levels = mip_chain(pixels, srgb)
    assert levels[0] is pixels
    assert levels[-1].shape == (1, 1, 4) and len(levels) == max(shape).bit_length()
    for at, level in enumerate(levels):
        height, width = level.shape[:2]
        assert (height, width) == tuple(max(side >> at, 1) for side in shape)
        blocks = pixels.reshape(height, shape[0] // height, width, shape[1] // width, 4)
        light = decoded(blocks) if srgb else blocks / 255.0
        light[..., 3] = blocks[..., 3] / 255.0
        found = decoded(level) if srgb else level / 255.0
        found[..., 3] = level[..., 3] / 255.0
        # Half a step of 8 bits: 1/510 of light, and of sRGB as much times its steepest slope, 2.27
        assert np.abs(found - light.mean((1, 3))).max() <= (2.3 if srgb else 1.0) / 510 + 1e-4


def test_one_colour_stays_that_colour():
    for value in range(256):
        pixels = np.full((4, 4, 4), value, np.uint8)
        assert all((level == value).all() for srgb in (True, False) for level in mip_chain(pixels, srgb))


def test_only_powers_of_two_can_be_halved():
    assert has_mip_chain(1, 512) and has_mip_chain(64, 64)
    assert not has_mip_chain(640, 512) and not has_mip_chain(512, 3)
