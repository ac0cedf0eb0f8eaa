"""From the levels' reflections to that of the starting level."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.glossy_gather import glossy_exists, uses_glossy
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


_PARTS = 5
"""Threads of a GPU that share a texel, one for each row of the window; see `passes/upsample.py`."""


class GlossyUpsample(ScreenPass):
    """Cross-bilateral filtering of reflections, coarsest level first: denoise a level, add the coarser ones.

    Source: Soler et al. 2010, "hierarchical upsampling". Differs: weights are tighter in normal than for irradiance,
    and count roughness, so that materials do not run into one another.
    """

    name = "glossy_upsample"
    shader = "passes/glossy_upsample.glsl"
    reads = {"surface": Read.of("surface"), "glossy_gather": Read.of("glossy_gather"),
             "coarse_surface": Read.of("surface", offset=1, optional=True),
             "coarse": Read.of("glossy_light", offset=1, optional=True)}
    writes = {"glossy_light": Target("reflection", "radiance reflected from this level and all coarser ones for a "
                                     "reflectance of 1, W m^-2 sr^-1, and roughness", "gather", exists=glossy_exists)}
    uniforms = {"texel": "float", "window": "int"}

    def enabled(self, settings: Settings) -> bool:
        return uses_glossy(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        chosen = switch("UPSAMPLING", frame.settings.upsampling, ("bilateral", "nearest"))
        last, denoises = frame.settings.last_level, frame.settings.upsampling == "bilateral"
        for level in range(last, frame.settings.start_level - 1, -1):
            omit = frozenset({"coarse", "coarse_surface"}) if level == last else frozenset()
            # The window's rows are a uniform so that compilers keep the loop
            yield Dispatch(level, {"texel": float(2**level), "window": 5}, (chosen,), omit,
                           parts=_PARTS if denoises and level > frame.settings.start_level else 1)
