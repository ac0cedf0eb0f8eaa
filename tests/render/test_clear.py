"""Pixels without a surface hold what the targets promise, whatever was there before."""

from __future__ import annotations

import numpy as np

from ssil_viewer.gpu.gl import GLFunctions
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera, Material
from ssil_viewer.settings import Settings
from tests import scenes


def test_integer_and_float_attachments_are_cleared(context):
    whole = context.texture((3, 2), 2, np.full((2, 3, 2), 0xDEADBEEF, np.uint32).tobytes(), dtype="u4")
    real = context.texture((3, 2), 4, np.full((2, 3, 4), 7.0, np.float32).tobytes(), dtype="f4")
    byte = context.texture((3, 2), 4, b"\x55" * 24)
    context.framebuffer([whole, real, byte], context.depth_texture((3, 2))).use()
    GLFunctions(context).clear((True, False, False), depth=True)
    assert not any(any(texture.read()) for texture in (whole, real, byte))


def test_nothing_is_left_of_the_last_frame(context):
    wall = scenes.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    renderer = Renderer(context, (16, 12), Settings())
    renderer.set_scene(scenes.scene([wall], (Material(emission=(1.0, 2.0, 3.0)),)))
    renderer.render(Camera(eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0)))
    assert renderer.read("view_depth").min() > 0.9
    renderer.render(Camera(eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 2.0)))    # looks away
    for name in ("view_depth", "normal", "albedo", "emission", "motion", "radiance", "indirect"):
        assert not renderer.read(name).any(), name
    renderer.release()
