"""On software OpenGL a thread may shade a block of texels, which share what they load. That changes no byte."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.pipeline import Renderer
from ssil_viewer.settings import Settings
from tests import scenes


@pytest.fixture
def stored(context):
    """`stored(blocks, size, **settings)`: by name and level all targets of the third frame, as stored, and the shaders
    that shade blocks."""
    capabilities = read_capabilities(context)
    if not (capabilities.compute and capabilities.software):
        pytest.skip("blocks are for compute shaders on software OpenGL")

    def render(blocks, size, **settings):
        with pytest.MonkeyPatch.context() as patch:
            if not blocks:
                patch.setattr(PassRunner, "software_compute", False)
            renderer = Renderer(context, size, Settings(**settings), keep=("final", "glossy"))
            try:
                renderer.set_scene(scenes.half_metal_cornell())
                for eye in (0.0, 0.02, 0.02):
                    camera = scenes.CORNELL_CAMERA
                    renderer.render(replace(camera, eye=tuple(np.add(camera.eye, (eye, 0.0, 0.0)))))
                runner = renderer.runner
                used = {variant.shader for variant in runner.variants if variant.block != (1, 1)}
                found = {(name, level): renderer.read_stored(name, level) for name in runner.plan.running_targets
                         for level in runner.declared[name].levels(runner.settings)}
            finally:
                renderer.release()
        assert bool(used) == blocks
        return found, used

    return render


@pytest.mark.parametrize(("size", "settings"), [
    ((157, 93), {}), ((157, 93), {"start_level": 3, "levels": 3, "temporal": False}), ((64, 48), {"start_level": 1}),
    ((65, 47), {"start_level": 0, "bounces": 2}), ((50, 33), {"upsampling": "nearest", "guard_band": 8}),
    ((17, 11), {"radius": 300.0}), ((3, 5), {"radius": 512.0}), ((1, 1), {"start_level": 2, "levels": 1})])
def test_blocks_change_no_byte(stored, size, settings):
    alone, _ = stored(False, size, **settings)
    together, _ = stored(True, size, **settings)
    assert alone.keys() == together.keys()
    for key, expected in alone.items():
        assert np.array_equal(together[key], expected), key
    assert size == (1, 1) or alone["upsample", 0].any() and alone["direct", 0].any()


def test_what_is_shaded_in_blocks(stored):
    """Up to the starting level there are coarse texels that four share; windows are not shared."""
    always = {f"passes/{name}.glsl" for name in ("temporal", "composite", "mipmap_radiance")}
    assert stored(True, (64, 48), start_level=1)[1] == always | {"passes/upsample.glsl"}
    assert stored(True, (64, 48), start_level=0)[1] == always
    assert stored(True, (64, 48), temporal=False)[1] >= {"passes/glossy_resolve.glsl"}
