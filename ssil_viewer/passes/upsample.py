"""From the levels' irradiance to the image's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import BLOCK, Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.reflect import MOST_BOUNCES, at_least, irradiance_of
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


PARTS = 4
"""Threads of a GPU that share a texel, one for each row of the window, beyond the starting level: so few texels do not
keep it busy."""


class Upsample(ScreenPass):
    """Cross-bilateral filtering, coarsest level first: denoise a level, add what the coarser ones sum to.

    Source: Soler et al. 2010, "hierarchical upsampling"; Eisemann and Durand 2004 for the cross-bilateral filter.
    Differs: each level is denoised over the 4x4 block in which its sample rotations repeat, at its own resolution
    where that is cheap, so that the steps to full resolution need three taps only.
    """

    name = "upsample"
    shader = "passes/upsample.glsl"
    reads = {"surface": Read.of("surface"), "gather": Read.of("gather", optional=True),
             "near": Read.of("near", optional=True),
             "coarse_surface": Read.of("surface", offset=1, optional=True),
             "coarse": Read.of("light", offset=1, optional=True),
             "albedo": Read.of("albedo", optional=True)}
    writes = {"light": Target("lobe", "light from this level and all coarser ones: flux and mean direction", "coarse"),
              "upsample": Target("rgb9e5", "irradiance of the first bounce in this frame alone, W m^-2"),
              **{f"upsample_{bounce}": Target("rgb9e5", f"irradiance of bounce {bounce} in this frame alone, W m^-2",
                                              exists=at_least(bounce)) for bounce in range(2, MOST_BOUNCES + 1)}}
    per_bounce = True
    uniforms = {"texel": "float", "window": "int", "is_coarsest": "bool"}

    def enabled(self, settings: Settings) -> bool:
        return settings.bounces > 0

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        chosen = switch("UPSAMPLING", frame.settings.upsampling, ("bilateral", "nearest"))
        last, denoises = frame.settings.last_level, frame.settings.upsampling == "bilateral"
        for level in range(last, -1, -1):
            # The image's own level evaluates the light at its normals; the others pass it on as it is
            omit = {f"upsample_{bounce}" for bounce in range(2, MOST_BOUNCES + 1)}
            omit.add("light" if level == 0 else "upsample")
            defines = [chosen, ("IMAGE_LEVEL", "")] if level == 0 else [chosen]
            missing = frozenset({"coarse", "coarse_surface"} if level == last else ())
            if level <= frame.settings.start_level or not frame.gpu_compute:    # no other level has its program
                omit |= missing
            if level < frame.settings.start_level:
                omit |= {"gather", "near"}
            if level > 0 or not frame.has_occlusion_maps:
                omit.add("albedo")
            # Four texels of the finer level have one coarse texel around them, and the same neighbours of it
            block = BLOCK if level < frame.settings.start_level and denoises else (1, 1)
            # The window's rows are a uniform so that compilers keep the loop: unrolled it takes them long
            yield Dispatch(level, {"texel": float(2**level), "window": 4, "is_coarsest": level == last}, tuple(defines),
                           frozenset(omit), {"upsample": irradiance_of(frame.bounce)},
                           parts=PARTS if denoises and level > frame.settings.start_level else 1,
                           unread=missing - omit, block=block)
