"""The pyramid of the extended G-buffer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import BLOCK, Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.rays import RAYS, corrects_visibility
from ssil_viewer.passes.reflect import sent_radiance
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


_LEVELS_AT_ONCE = 5     # a group of 16x16 threads ends with one texel


class Mipmap(ScreenPass):
    """Levels 1 to the last one of depth and normal, by vote.

    Source: Soler et al. 2010, "voting mipmaps". Differs: a texel votes with the share of its footprint that it stands
    for, and the winner's surface is averaged over the texels that lie on it (docs/method/mipmap.md).
    """

    name = "mipmap"
    serves = frozenset({"environment"})     # whose occlusion is looked for on coarse surfaces
    shader = "passes/mipmap.glsl"
    reads = {"surface": Read.of("surface", offset=-1),
             "finer_winner": Read.of("winner", offset=-1, optional=True)}
    extends = ("surface",)
    writes = {"winner": Target("index8", "which of its four finer texels a texel kept, x + 2 y, and in the "
                                      "upper six bits the share of its footprint that lies on that surface", "coarse")}
    uniforms = {"texel": "float", "finer_is_voted": "bool", "mirrored": "bool"}

    def enabled(self, settings: Settings) -> bool:
        return settings.bounces > 0

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        chosen = switch("MIP_FILTER", frame.settings.mip_filter, ("vote", "nearest", "average"))
        voted = frame.settings.mip_filter == "vote"
        for level in range(1, frame.settings.last_level + 1):
            # texel: width of a texel that is read, in level-0 pixels
            finer_is_voted = voted and level > 1
            uniforms = {"texel": float(2 ** (level - 1)), "finer_is_voted": finer_is_voted, "mirrored": level % 2 == 0}
            missing = frozenset() if finer_is_voted else frozenset({"finer_winner"})
            if voted and frame.gpu_compute:
                yield Dispatch(level, uniforms, (chosen,), unread=missing)
            else:
                yield Dispatch(level, uniforms, (chosen,), missing)


class MipmapRadiance(ScreenPass):
    """Levels 1 to the last one of radiance: the mean, so that the light that a block sends keeps its sum.

    It runs after direct light, which may need the coarse surfaces.
    """

    name = "mipmap_radiance"
    shader = "passes/mipmap_radiance.glsl"
    reads = {"radiance": Read.of("radiance", offset=-1)}
    extends = ("radiance",)
    per_bounce = True

    def enabled(self, settings: Settings) -> bool:
        return settings.bounces > 0

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        defines = (("NEAREST", ""),) if frame.settings.mip_filter == "nearest" else ()
        last = frame.settings.last_level
        at_once = _LEVELS_AT_ONCE if frame.gpu_compute else 1
        for level in range(1, last + 1, at_once):
            yield Dispatch(level, {}, defines, targets=sent_radiance(frame.bounce),
                           levels=min(at_once, last + 1 - level), block=BLOCK)


class MipmapBrightest(ScreenPass):
    """Levels 1 to the last one of where the brightest pixels are: a texel sends the light of all its pixels, and they
    may lie elsewhere than the surface that the vote kept."""

    name = "mipmap_brightest"
    shader = "passes/mipmap_brightest.glsl"
    reads = {"radiance": Read.of("radiance", offset=-1), "finer": Read.of("surface", offset=-1)}
    writes = {"brightest": Target("surface", "surface of the brightest pixel of each texel, or nearly so", "coarse",
                                  exists=corrects_visibility)}
    requires = RAYS
    per_bounce = True

    def enabled(self, settings: Settings) -> bool:
        return corrects_visibility(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        if frame.rays_are_stale:
            return      # nobody reads it then
        for level in range(1, frame.settings.last_level + 1):
            finer = {} if level == 1 else {"finer": "brightest"}
            yield Dispatch(level, targets=sent_radiance(frame.bounce) | finer)
