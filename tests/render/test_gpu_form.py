"""Compute shaders as a GPU gets them, whose threads share texels and write several levels at once. They also run on
software OpenGL, which gets another form by itself."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.pipeline import Renderer
from ssil_viewer.settings import Settings
from tests import scenes


@pytest.fixture
def in_both_forms(context):
    """`both(size, **settings)`: buffers of two frames, by form, name and level."""
    if not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")

    def both(size, **settings):
        found = {}
        for software in (True, False):
            renderer = Renderer(context, size, Settings(**{"levels": 4, "start_level": 1} | settings), stage="compute",
                                keep=("final", "glossy"))
            renderer.runner.software_form = software
            renderer.set_scene(scenes.half_metal_cornell())
            for _ in range(2):
                renderer.render(scenes.CORNELL_CAMERA)
            found[software] = {(name, level): renderer.read(name, level) for name, info in renderer.buffers().items()
                               for level in info.levels}
            shared = {variant.parts * variant.levels for variant in renderer.runner._programs}
            renderer.release()
            assert (shared == {1}) == (software or settings.get("levels") == 1)
        return found[True], found[False]

    return both


@pytest.mark.parametrize(("size", "settings"), [
    ((157, 93), {"visibility": "off"}), ((33, 70), {"visibility": "horizon", "bounces": 2}),
    ((157, 93), {"visibility": "voxel", "samples": 9, "sample_spacing": "area"}),
    ((64, 48), {"visibility": "off", "mip_filter": "nearest", "upsampling": "nearest", "samples": 1}),
    ((64, 48), {"visibility": "off", "start_level": 0, "levels": 1, "glossy_samples": 0}),
    ((67, 45), {"visibility": "off", "start_level": 1, "levels": 1}), ((53, 48), {"start_level": 0, "levels": 7}),
    ((64, 48), {"samples": 80}), ((64, 48), {"samples": 7}), ((64, 48), {"visibility": "off", "samples": 7})])
def test_both_forms_make_the_same_picture(in_both_forms, size, settings):
    """Sums in another order, which stored colours of nine bits show as one step."""
    software, gpu = in_both_forms(size, **settings)
    assert software.keys() == gpu.keys()
    for key, expected in software.items():
        assert gpu[key] == pytest.approx(expected, rel=4e-3, abs=2e-3 * max(float(np.abs(expected).max()), 1e-9)), key


def test_levels_of_radiance_made_at_once_are_those_made_one_by_one(in_both_forms):
    software, gpu = in_both_forms((157, 93), levels=7, visibility="off")
    for level in range(1, 8):
        assert (software["radiance", level] == gpu["radiance", level]).all()
        assert software["radiance", level].any()
