"""The extended G-buffer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Pass

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame


class GBuffer(Pass):
    """Geometry, material and motion of the nearest surface of each pixel, in one pass over the triangles.

    Source: Soler et al. 2010, "extended G-buffer". Differs: depth and normal share one 64-bit texel, so that the
    gather reads a sender's geometry with one fetch.
    """

    name = "gbuffer"
    writes = {
        "surface": Target("surface", "view depth in metres (0 = background) and unit view-space normal",
                          "pyramid", history=True),
        "albedo": Target("reflectance", "diffuse reflectance; alpha: the material's occlusion map"),
        "specular": Target("reflectance", "reflectance at normal incidence F0; alpha: roughness"),
        "emission": Target("rgb9e5", "emitted radiance, W m^-2 sr^-1"),
        "motion": Target("rgba16f", "displacement since the last frame in image widths and heights; "
                                    "z: old view depth / view depth; alpha: normal of the triangle itself"),
    }

    def execute(self, frame: SceneFrame) -> None:
        context = frame.context
        context.enable_only(moderngl.DEPTH_TEST)
        frame.framebuffer(self, depth=True).use()
        frame.clear(self, depth=True)
        frame.draw_gbuffer(tuple((name, target.format) for name, target in self.writes.items()))
        context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)     # as screen passes expect it
