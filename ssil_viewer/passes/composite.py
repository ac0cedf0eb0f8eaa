"""The picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.antialias import smooths_edges
from ssil_viewer.passes.base import BLOCK, Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.glossy_gather import glossy_exists, uses_glossy
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


class Composite(ScreenPass):
    """final = direct + albedo * irradiance / pi + glossy, then exposure, tone curve and sRGB encoding.

    glossy is Fresnel's reflectance times the reflected radiance. Here the guard band ends.
    """

    name = "composite"
    shader = "passes/composite.glsl"
    reads = {"direct": Read.of("direct"), "albedo": Read.of("albedo", optional=True),
             "irradiance": Read.of("irradiance", "all_bounces", "upsample", optional=True),
             "reflection": Read.of("reflection", "reflection_now", optional=True),
             "surface": Read.of("surface", optional=True), "specular": Read.of("specular", optional=True)}
    writes = {
        "final": Target("rgba16f", "radiance towards the camera, W m^-2 sr^-1", optional=True, cropped=True),
        "glossy": Target("rgba16f", "what glossy reflection of indirect light adds to `final`, W m^-2 sr^-1",
                         optional=True, cropped=True, exists=glossy_exists),
        "display": Target("rgba8", "the picture, sRGB-encoded", cropped=True),
        "aliased": Target("bits32", "the picture before its edges are smoothed, sRGB-encoded; in the upper byte "
                          "brightness", cropped=True, exists=smooths_edges),
    }
    uniforms = {"band": "ivec2"}
    shows = ("both", "direct", "indirect", "glossy")
    tone_maps = ("aces", "neutral", "reinhard", "linear")

    @staticmethod
    def drawn_to(settings: Settings) -> tuple[str, tuple[tuple[str, str], ...]]:
        """The target that the picture goes to, which the shader calls display, and definitions for it."""
        return ("aliased", (("SMOOTHED", ""),)) if smooths_edges(settings) else ("display", ())

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        defines = [switch("SHOW", frame.settings.show, self.shows),
                   switch("TONE_MAP", frame.settings.tone_map, self.tone_maps)]
        omit = {"aliased"}
        if frame.settings.bounces == 0:
            omit |= {"albedo", "irradiance"}
        if not uses_glossy(frame.settings):
            omit |= {"reflection", "surface", "specular"}   # `glossy`, where it exists, is black
        for name in ("final", "glossy"):
            if name not in omit and frame.has_target(name):
                defines.append((f"WRITE_{name.upper()}", ""))
            else:
                omit.add(name)
        drawn, smoothed = self.drawn_to(frame.settings)
        targets = {} if drawn == "display" else {"display": drawn}
        defines += smoothed
        yield Dispatch(0, {"band": frame.band}, tuple(defines), frozenset(omit), targets, block=BLOCK)
