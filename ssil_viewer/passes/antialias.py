"""Smooth edges of the picture."""

from __future__ import annotations

from ssil_viewer.passes.base import Read, ScreenPass
from ssil_viewer.settings import Settings


def smooths_edges(settings: Settings) -> bool:
    """Whether the picture goes through `Antialias`."""
    return settings.antialias


class Antialias(ScreenPass):
    """Blends pixels at the steps of edges with what lies beyond, by the share that the line behind the steps leaves it.

    Source: Reshetov 2009, "Morphological antialiasing"; the search along an edge and the treatment of lone pixels as in
    Lottes 2009, "FXAA". Differs: light is blended, not its sRGB codes.
    """

    name = "antialias"
    shader = "passes/antialias.glsl"
    reads = {"aliased": Read.of("aliased")}
    extends = ("display",)

    def enabled(self, settings: Settings) -> bool:
        return smooths_edges(settings)
