"""The picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass, switch

if TYPE_CHECKING:
    from ssil_viewer.pass_runner import Frame


class Composite(ScreenPass):
    """final = direct + albedo * irradiance / pi, then exposure, tone curve and sRGB encoding; here the guard band ends.
    """

    name = "composite"
    shader = "passes/composite.glsl"
    reads = {"direct": Read.of("direct"), "albedo": Read.of("albedo", optional=True),
             "irradiance": Read.of("irradiance", "all_bounces", "upsample", optional=True)}
    writes = {
        "final": Target("rgba16f", "radiance towards the camera, W m^-2 sr^-1", optional=True, cropped=True),
        "display": Target("rgba8", "the picture, sRGB-encoded", cropped=True),
    }
    uniforms = {"band": "ivec2"}
    tone_maps = ("aces", "neutral", "reinhard", "linear")

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        defines = [switch("SHOW", frame.settings.show, ("both", "direct", "indirect")),
                   switch("TONE_MAP", frame.settings.tone_map, self.tone_maps)]
        omit: set[str] = set()
        if frame.settings.bounces == 0:
            omit |= {"albedo", "irradiance"}
        if frame.has_target("final"):
            defines.append(("WRITE_FINAL", ""))
        else:
            omit.add("final")
        yield Dispatch(0, {"band": frame.band}, tuple(defines), frozenset(omit))
