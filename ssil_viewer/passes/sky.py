"""How much of the environment's light arrives past what the image shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass
from ssil_viewer.passes.glossy_gather import GLOSSY, uses_glossy

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame

ENVIRONMENT = frozenset({"environment"})


class Sky(ScreenPass):
    """Occluded over unoccluded irradiance from the environment at the starting level, from screen-space horizons.

    Source: Therrien et al. 2023, "Screen space indirect lighting with visibility bitmask"; slices as in Jimenez et al.
    2016. Differs: sectors are weighted by the environment's own light, so that what hides the sun counts more than what
    hides a dark corner; far steps read coarser levels.
    """

    name = "sky"
    requires = ENVIRONMENT
    shader = "passes/sky.glsl"
    reads = {"surface": Read.of("surface"),
             **{f"surface_{i}": Read.of("surface", offset=i, optional=True) for i in (1, 2, 3)},
             "image_surface": Read.of("surface", offset=None, optional=True),
             "specular": Read.of("specular", offset=None, optional=True)}
    tables = {"environment_specular": "sampler2D"}
    writes = {"sky_noisy": Target("rgba8", "share of the environment's irradiance that arrives, by slices that "
                                           "differ in each of 4x4 texels; alpha: of its reflection", "start")}
    uniforms = {"texel": "float", "coarsest": "int", "directions": "int", "steps": "int", "thickness": "float",
                "gather_reach": "float"}

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        settings = frame.settings
        # In texels: how far the glossy gather looks, which brings the light of what takes the environment's place
        reach = frame.radius * 2.0**(settings.last_level - settings.start_level) if uses_glossy(settings) else 0.0
        coarsest = min(settings.levels - 1, 3)
        omit = {f"surface_{i}" for i in range(coarsest + 1, 4)}
        if not frame.has_feature(*GLOSSY):
            omit |= {"image_surface", "specular", "gather_reach"}
        yield Dispatch(settings.start_level, {
            "texel": float(2**settings.start_level), "coarsest": coarsest, "directions": settings.sky_directions,
            "steps": settings.sky_steps, "thickness": settings.sky_thickness,
            "gather_reach": reach,
        }, omit=frozenset(omit))


class SkyFilter(ScreenPass):
    """The same without noise: a cross-bilateral filter over the 4x4 texels in which the slices differ and, with the
    temporal filter, a mean over frames in which nothing moves."""

    name = "sky_filter"
    requires = ENVIRONMENT
    shader = "passes/sky_filter.glsl"
    reads = {"surface": Read.of("surface"), "sky_noisy": Read.of("sky_noisy"),
             "sky_history": Read.of("sky@previous", optional=True)}
    writes = {"sky": Target("rgba16f", "share of the environment's irradiance that arrives, mean over frames; alpha: "
                                       "of its reflection", "start", history=True)}
    uniforms = {"texel": "float", "window": "int"}

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        level = frame.settings.start_level
        omit = frozenset() if frame.settings.temporal else frozenset({"sky_history"})
        yield Dispatch(level, {"texel": float(2**level), "window": 5}, omit=omit)
