"""Shadow maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl

from ssil_viewer.passes.base import Pass

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame


class Shadows(Pass):
    """Depth of the scene from every light, in one atlas; only in frames where a light or an object moved.

    Source: Williams 1978. One map for a directional or spot light, six for a point light.
    """

    name = "shadows"

    def execute(self, frame: SceneFrame) -> None:
        if not frame.shadows_stale or not frame.lights.tiles:
            return
        context = frame.context
        context.enable_only(moderngl.DEPTH_TEST)
        frame.lights.framebuffer.use()
        frame.lights.framebuffer.clear()
        # Against acne at slopes; the rest is done by moving the receiver (shaders/lib/lights.glsl)
        context.polygon_offset = (1.5, 2.0)
        for tile in frame.lights.tiles:
            frame.lights.framebuffer.viewport = (*tile.corner, tile.side, tile.side)
            clip = tile.clip_from_world.T.astype("f4").tobytes()
            frame.draw_depth(clip)
        context.polygon_offset = (0.0, 0.0)
