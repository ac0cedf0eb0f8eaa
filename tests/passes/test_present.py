"""The picture onto framebuffers of other sizes."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.gpu.present import Presenter


@pytest.mark.parametrize("viewport", [(0, 0, 48, 20), (16, 4, 32, 16)])
@pytest.mark.parametrize("right_of", [0.0, 0.25])
def test_it_fills_the_viewport_and_leaves_the_rest(context, viewport, right_of):
    """Each texel of 4x2 is a block of its own; what is left of `right_of` and outside stays as it was."""
    texels = np.random.default_rng(1).integers(1, 256, (2, 4, 4), np.uint8)
    picture, target = context.texture((4, 2), 4, texels.tobytes()), context.texture((48, 20), 4)
    framebuffer = context.framebuffer([target])
    framebuffer.clear()
    framebuffer.viewport = viewport
    presenter = Presenter(context)
    presenter.draw(picture, framebuffer, right_of, smooth=False)
    found = np.frombuffer(target.read(), np.uint8).reshape(20, 48, 4)
    x, y, width, height = viewport
    expected = np.zeros_like(found)
    expected[y:y + height, x:x + width] = texels.repeat(height // 2, 0).repeat(width // 4, 1)
    expected[:, :x + round(right_of * width)] = 0
    assert np.array_equal(found, expected)
    context.resting_framebuffer.use()
    for item in (presenter, framebuffer, target, picture):
        item.release()


def test_smooth_between_texels(context):
    picture, target = context.texture((2, 1), 4, bytes([0] * 4 + [200] * 4)), context.texture((8, 1), 4)
    framebuffer = context.framebuffer([target])
    presenter = Presenter(context)
    presenter.draw(picture, framebuffer)
    found = np.frombuffer(target.read(), np.uint8).reshape(8, 4)[:, 0]
    assert found[0] == 0 and found[-1] == 200 and (np.diff(found.astype(int)) >= 0).all()
    assert found[3:5] == pytest.approx([75, 125], abs=1)
    context.resting_framebuffer.use()
    for item in (presenter, framebuffer, target, picture):
        item.release()


def test_of_a_picture_twice_as_large_each_pixel_is_the_mean_of_four(context):
    texels = np.random.default_rng(2).integers(0, 256, (8, 12, 4), np.uint8)
    picture, target = context.texture((12, 8), 4, texels.tobytes()), context.texture((6, 4), 4)
    framebuffer = context.framebuffer([target])
    presenter = Presenter(context)
    presenter.draw(picture, framebuffer)
    found = np.frombuffer(target.read(), np.uint8).reshape(4, 6, 4)
    assert found == pytest.approx(texels.reshape(4, 2, 6, 2, 4).mean((1, 3)), abs=1)
    context.resting_framebuffer.use()
    for item in (presenter, framebuffer, target, picture):
        item.release()
