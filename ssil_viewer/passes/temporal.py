"""Reuse of the last frames' light."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import BLOCK, Dispatch, Read, ScreenPass
from ssil_viewer.passes.glossy_gather import uses_glossy
from ssil_viewer.passes.glossy_resolve import to_image
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


def averages_reflections(settings: Settings) -> bool:
    """Whether the reflections are a mean over frames."""
    return settings.temporal and uses_glossy(settings)


class Temporal(ScreenPass):
    """Running means along each surface point's way over the screen, of irradiance and of what glossy surfaces reflect.

    Source: Nehab et al. 2007, "reverse reprojection caching". History is refused where depth or normal differ,
    relative to depth, and shortened where the light changed. That of reflections follows the reflecting surface, not
    what is seen in it, and while anything moves is held within what the neighbours reflect now, as temporal
    antialiasing does (Karis 2014).
    """

    name = "temporal"
    shader = "passes/temporal.glsl"
    reads = {"surface": Read.of("surface"), "upsample": Read.of("all_bounces", "upsample"), "motion": Read.of("motion"),
             "previous_surface": Read.of("surface@previous"), "history": Read.of("irradiance@previous"),
             "light": Read.of("light", offset=1, optional=True),
             "coarse_surface": Read.of("surface", offset=1, optional=True),
             "specular": Read.of("specular", optional=True),
             "start_surface": Read.of("surface", offset="start", optional=True),
             "glossy_light": Read.of("glossy_light", offset="start", optional=True),
             "reflection_history": Read.of("reflection@previous", optional=True)}
    writes = {"irradiance": Target("rgba16f", "irradiance, mean over frames, W m^-2; alpha: number of frames",
                                   history=True),
              "reflection": Target("rgb9e5", "radiance reflected for a reflectance of 1, mean over frames, "
                                   "W m^-2 sr^-1", history=True, exists=averages_reflections)}
    uniforms = {"texel": "float"}

    def enabled(self, settings: Settings) -> bool:
        return settings.temporal and settings.bounces > 0

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        settings = frame.settings
        defines, omit = [], set()
        if frame.still and frame.software_form:
            # Where each pixel was is known. By a branch software OpenGL would spare nothing: it takes both sides
            defines.append(("STILL", ""))
            omit |= {"motion", "previous_surface", "light", "coarse_surface"}
        if not frame.has_target("light", 1):    # no level is coarse, or another method has made the light
            omit |= {"light", "coarse_surface"}
        if averages_reflections(settings):
            defines += to_image(settings)
        else:
            omit |= {"specular", "start_surface", "glossy_light", "reflection_history", "reflection", "texel"}
        yield Dispatch(0, {"texel": float(2**settings.start_level)}, tuple(defines), frozenset(omit),
                       block=BLOCK)
