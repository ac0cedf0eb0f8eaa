"""The image's reflections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import BLOCK, Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.glossy_gather import uses_glossy
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


def _is_needed(settings: Settings) -> bool:
    return uses_glossy(settings) and not settings.temporal


def to_image(settings: Settings) -> tuple[tuple[str, str], ...]:
    """Definitions of shaders/passes/glossy_to_image.glsl."""
    chosen = switch("UPSAMPLING", settings.upsampling, ("bilateral", "nearest"))
    return (chosen, ("SAME_TAPS", "")) if settings.start_level > 1 else (chosen,)


class GlossyResolve(ScreenPass):
    """Reflections from the starting level's resolution to the image's; with the temporal filter, that does it.

    Source: Soler et al. 2010.
    """

    name = "glossy_resolve"
    shader = "passes/glossy_resolve.glsl"
    reads = {"surface": Read.of("surface"), "specular": Read.of("specular"),
             "start_surface": Read.of("surface", offset="start"),
             "glossy_light": Read.of("glossy_light", offset="start")}
    writes = {"reflection_now": Target("rgb9e5", "radiance reflected for a reflectance of 1 in this frame alone, "
                                       "W m^-2 sr^-1", exists=_is_needed)}
    uniforms = {"texel": "float"}

    def enabled(self, settings: Settings) -> bool:
        return _is_needed(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        yield Dispatch(0, {"texel": float(2**frame.settings.start_level)}, to_image(frame.settings), block=BLOCK)
