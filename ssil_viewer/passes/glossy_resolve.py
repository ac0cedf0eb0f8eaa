"""The image's reflections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.glossy_gather import glossy_exists, uses_glossy
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.pass_runner import Frame


class GlossyResolve(ScreenPass):
    """Reflections from the starting level's resolution to the image's, and their mean over frames.

    Source: Soler et al. 2010 for both steps; the history is held within what the neighbours reflect now, as temporal
    antialiasing does (Karis 2014). It follows the reflecting surface, not what is seen in it.
    """

    name = "glossy_resolve"
    shader = "passes/glossy_resolve.glsl"
    reads = {"surface": Read.of("surface"), "specular": Read.of("specular"),
             "start_surface": Read.of("surface", offset="start"),
             "glossy_light": Read.of("glossy_light", offset="start"),
             "irradiance": Read.of("irradiance", optional=True), "motion": Read.of("motion", optional=True),
             "previous_surface": Read.of("surface@previous", optional=True),
             "history": Read.of("reflection@previous", optional=True)}
    writes = {"reflection": Target("rgb9e5", "radiance reflected for a reflectance of 1, mean over frames, "
                                   "W m^-2 sr^-1", history=True, exists=glossy_exists)}
    uniforms = {"texel": "float"}

    def enabled(self, settings: Settings) -> bool:
        return uses_glossy(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        start = frame.settings.start_level
        chosen = switch("UPSAMPLING", frame.settings.upsampling, ("bilateral", "nearest"))
        omit = {"irradiance", "motion", "previous_surface", "history"} if not frame.settings.temporal else set()
        yield Dispatch(0, {"texel": float(2**start)}, (chosen,), frozenset(omit))
