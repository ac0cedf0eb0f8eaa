"""Light does not come out of the inside of things."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.headless import render_frames
from ssil_viewer.scene import default_camera, load_scene


@pytest.mark.parametrize("visibility", ["off", "horizon"])
def test_the_narrow_side_of_a_box_has_no_light_from_within(make_renderer, visibility):
    """The low box of the Cornell box shows a side a few pixels wide at its foot that no coarse texel keeps. Its front
    has the red wall's light on its other side; the narrow side sees nothing of that wall."""
    cornell = load_scene("builtin:cornell")
    renderer = make_renderer(cornell, (1280, 720), visibility=visibility)
    render_frames(renderer, default_camera(cornell), 4)
    normal, light = renderer.read("normal"), renderer.read("indirect")
    rows, columns = np.mgrid[:720, :1280]
    side = (normal[..., 0] > 0.9) & (rows > 640) & (columns > 800) & (columns < 860)
    assert side.sum() > 300
    red = light[side, 0]
    assert np.median(red) > 0.01
    assert red.max() < 2.5 * np.median(red)
