"""OpenGL 3.3 promises a fragment shader 16 textures, and some drivers have no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import AREA_KINDS, Camera, Image, Light, Material, TextureRef
from tests import scenes

MOST = 16


@pytest.mark.parametrize("settings", [
    dict(feedback=True), dict(bounces=4), dict(visibility="voxel", voxel_slices=256),
    dict(shadow_rays=True, unseen_samples=2, visibility_rays=2),
    dict(shadow_rays=True, unseen_samples=2, visibility_rays=2, feedback=True)],
    ids=lambda settings: " ".join(settings))
def test_no_pass_needs_more_than_there_are(make_renderer, settings):
    """With all that a scene can have: holes, gloss, an environment, lamps with and without area."""
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, :4, 3] = 0
    cut = Material(base_color_texture=TextureRef(0), alpha_mode="mask", double_sided=True, roughness=0.3)
    scene = scenes.scene((scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)),
                          scenes.rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0), 1)), (Material(roughness=0.4), cut),
                         [Light(kind, intensity=3.0, position=(0, 0, 2)) for kind in ("point", *AREA_KINDS)])
    even = Environment("even", np.ones((8, 16, 3), np.float32))
    scene = replace(scene, images=(Image("half", pixels),), environment=even)
    renderer = make_renderer(scene, (64, 48), "fragment", **settings)
    for _ in range(2):
        renderer.render(Camera(eye=(0, 0, 4), vertical_fov=0.8))
    units = renderer.runner.texture_units()
    assert units["passes/direct.glsl"] > 8, "nothing was counted"
    assert {name: count for name, count in units.items() if count > MOST} == {}
