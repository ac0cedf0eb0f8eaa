"""Shadow maps, and shadows by rays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

import moderngl

from ssil_viewer.gpu.light_table import LIGHT_TABLES
from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Pass, Read, ScreenPass
from ssil_viewer.passes.rays import RAY_TABLES, RAY_UNIFORMS, RAYS, ray_defines, ray_uniforms, traces_shadows
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame


class Shadows(Pass):
    """Depth of the scene from every light, in one atlas; only in frames where a light or an object moved.

    Source: Williams 1978. One map for a directional or spot light, six for a point light, three for each of the points
    on an area light.
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


class ShadowRays(ScreenPass):
    """Which lights without area a pixel sees, by rays against the scene's triangles, where the shadow maps leave light.

    A pass of its own, since OpenGL 3.3 has 16 textures in a fragment shader, and `Direct` may need most of them.
    """

    name = "shadow_rays"
    requires = RAYS
    shader = "passes/shadow_rays.glsl"
    reads = {"surface": Read.of("surface"), "motion": Read.of("motion")}
    tables = {**LIGHT_TABLES, **RAY_TABLES}
    writes = {"traced": Target("bits32", "two bits for each of the first 16 lights: 0 as the shadow map says, 1 seen, "
                                         "2 hidden", exists=traces_shadows)}
    uniforms = {"punctual_lights": "int", **RAY_UNIFORMS}

    def enabled(self, settings: Settings) -> bool:
        return traces_shadows(settings)

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        if not frame.rays_are_stale:
            uniforms = {"punctual_lights": frame.lights.punctual_count, **ray_uniforms(frame)}
            yield Dispatch(0, uniforms, ray_defines(frame))
