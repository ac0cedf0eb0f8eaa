"""Reuse of the last frames' light."""

from __future__ import annotations

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Read, ScreenPass
from ssil_viewer.settings import Settings


class Temporal(ScreenPass):
    """Running mean of the irradiance along each surface point's way over the screen.

    Source: Nehab et al. 2007, "reverse reprojection caching". History is refused where depth or normal differ,
    relative to depth, and shortened where the light changed.
    """

    name = "temporal"
    shader = "passes/temporal.glsl"
    reads = {"surface": Read.of("surface"), "upsample": Read.of("all_bounces", "upsample"), "motion": Read.of("motion"),
             "previous_surface": Read.of("surface@previous"), "history": Read.of("irradiance@previous")}
    writes = {"irradiance": Target("rgba16f", "irradiance, mean over frames, W m^-2; alpha: number of frames",
                                   history=True)}

    def enabled(self, settings: Settings) -> bool:
        return settings.temporal and settings.bounces > 0
