"""Ambient occlusion with ambient light, as a frame of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Callable, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes import Composite, Direct, GBuffer, Mipmap, ShadowRays, Shadows, Sky, SkyFilter, Temporal
from ssil_viewer.passes.base import Dispatch, Pass, Read, ScreenPass
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame

OWN = ("gtao", "gtao_filter", "temporal", "composite")
"""The passes that ambient occlusion adds to a deferred renderer, and those that ours has, too."""


@dataclass(frozen=True)
class Occlusion:
    """How ambient occlusion is looked for.

    Attributes:
        radius: Metres within which a surface blocks.
        slices: Half turns through the view ray.
        steps: To each side of a slice. Three slices of three are what XeGTAO calls high quality.
    """

    radius: float = 1.0
    slices: int = 3
    steps: int = 3

    @property
    def samples(self) -> int:
        """Lookups of each pixel."""
        return 2 * self.slices * self.steps


class GroundTruthOcclusion(ScreenPass):
    """Share of an even ambient light that arrives at each pixel, weighted by the cosine, from screen-space horizons.

    Source: Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion"; the fade and the
    spacing of the steps as in XeGTAO. Differs: a slice's light is divided by what an open one would get, so that an
    open plane has no noise; surfaces are followed along their planes between texels; no pyramid of depths, no
    thickness heuristic, and no colours of further bounces, since one bounce is what it is compared with.

    Attributes:
        occlusion: May be replaced between frames; who does so drops the history.
    """

    name = "gtao"
    shader = "peers/gtao.glsl"
    reads = {"surface": Read.of("surface")}
    writes = {"ambient_noisy": Target("rgba8", "share of ambient light that arrives, by slices that differ in each of "
                                               "4x4 pixels")}
    uniforms = {"texel": "float", "radius": "float", "slices": "int", "steps": "int"}

    def __init__(self) -> None:
        self.occlusion = Occlusion()

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        yield Dispatch(0, {"texel": 1.0, "radius": self.occlusion.radius, "slices": self.occlusion.slices,
                           "steps": self.occlusion.steps})


class OcclusionFilter(ScreenPass):
    """The same without noise, where the temporal filter and the picture look for irradiance."""

    name = "gtao_filter"
    shader = "peers/gtao_filter.glsl"
    reads = {"surface": Read.of("surface"), "ambient_noisy": Read.of("ambient_noisy")}
    writes = {"upsample": Target("rgb9e5", "share of ambient light that arrives, in this frame alone")}
    uniforms = {"texel": "float", "window": "int"}

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        yield Dispatch(0, {"texel": 1.0, "window": 5})


class SkyMipmap(Mipmap):
    """Coarse surfaces only where an environment needs them: ambient occlusion itself has no pyramid."""

    def enabled(self, settings: Settings) -> bool:
        return False


def occlusion_frame(occlusion: GroundTruthOcclusion) -> tuple[Callable[[], Pass], ...]:
    """The passes of a frame in which `irradiance` is that of an ambient light of 1, occluded."""
    return (Shadows, GBuffer, SkyMipmap, Sky, SkyFilter, ShadowRays, Direct, lambda: occlusion, OcclusionFilter,
            Temporal, Composite)


def occlusion_settings(settings: Settings) -> Settings:
    """Settings under which `occlusion_frame` runs."""
    return replace(settings, bounces=1, feedback=False, visibility="off", glossy_samples=0, unseen_samples=0)
