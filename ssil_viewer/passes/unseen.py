"""Light from surfaces that the image does not show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.light_table import LIGHT_TABLES
from ssil_viewer.gpu.targets import DRAWN_SIDE, SURFEL_BITS, Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass
from ssil_viewer.passes.glossy_gather import uses_glossy
from ssil_viewer.passes.rays import (
    RAY_TABLES,
    RAY_UNIFORMS,
    RAYS,
    gathers_unseen,
    random_seed,
    ray_defines,
    ray_uniforms,
)
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame

_RAYS_TO_REFLECT = 2    # one ray of the lobe for so many of the diffuse part
_CANDIDATES = 8         # of each ray: measured, see docs/method/unseen.md
# Of shaders/lib/unseen.glsl
_LIGHT = {**RAY_TABLES, **LIGHT_TABLES, "environment_irradiance": "sampler2D"}
_SHOWN = {"image_surface": Read.of("surface", offset=None), "motion": Read.of("motion", offset=None)}
_LIGHT_UNIFORMS = {"punctual_lights": "int", "random_seed": "int", **RAY_UNIFORMS}


def _light_defines(frame: SceneFrame) -> tuple[tuple[str, str], ...]:
    defines = [(f"AREA_{kind.upper()}", "") for kind in frame.lights.area_kinds]
    if frame.has_feature("environment"):
        defines.append(("ENVIRONMENT", ""))
    if frame.settings.unseen_from == "view":
        defines.append(("VIEW_ALONE", ""))
    return (*defines, *ray_defines(frame))


def _light_uniforms(frame: SceneFrame) -> dict[str, object]:
    return {"punctual_lights": frame.lights.punctual_count, "random_seed": random_seed(frame), **ray_uniforms(frame)}


class _UnseenPass(ScreenPass):
    requires = RAYS

    def enabled(self, settings: Settings) -> bool:
        return gathers_unseen(settings)


class UnseenLight(_UnseenPass):
    """Direct light on the surfels of the scene, and what of it the image does not show.

    Source: virtual point lights after Keller 1997, "Instant radiosity", laid onto the surfaces evenly by area.
    """

    name = "unseen_light"
    shader = "passes/unseen_light.glsl"
    reads = _SHOWN
    tables = {"surfel_position": "sampler2D", "surfel_normal": "sampler2D", "surfel_albedo": "sampler2D",
              "surfel_emission": "sampler2D", **_LIGHT}
    writes = {"unseen_radiance": Target("rgba32f", "diffuse exitant radiance of each surfel, W m^-2 sr^-1, 0 where the "
                                        "image shows it; alpha: radiance times area", "surfels", exists=gathers_unseen)}
    uniforms = _LIGHT_UNIFORMS

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        yield Dispatch(0, _light_uniforms(frame), _light_defines(frame))


class UnseenSums(_UnseenPass):
    """Pyramid of sums over the surfels' light, down which `UnseenDraw` finds its way.

    Source: Clarberg et al. 2005, "Wavelet importance sampling", hierarchical warping.
    """

    name = "unseen_sums"
    shader = "passes/unseen_sums.glsl"
    reads = {"radiance": Read.of("unseen_radiance", offset=None, optional=True),
             "finer": Read.of("unseen_sums", offset=-1, optional=True)}
    writes = {"unseen_sums": Target("rgba32f", "radiance times area, summed over each quarter of what a texel covers",
                                    "surfel_sums", exists=gathers_unseen)}

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        for level in range(1, SURFEL_BITS + 1):
            yield Dispatch(level, omit=frozenset({"finer" if level == 1 else "radiance"}))


class UnseenDraw(_UnseenPass):
    """Senders of one frame, drawn from the surfels in proportion to their light, so that all carry the same."""

    name = "unseen_draw"
    shader = "passes/unseen_draw.glsl"
    reads = {"radiance": Read.of("unseen_radiance", offset=None),
             **{f"sums_{level}": Read.of("unseen_sums", offset=level) for level in range(1, SURFEL_BITS + 1)}}
    tables = {"surfel_position": "sampler2D", "surfel_normal": "sampler2D"}
    writes = {"unseen_position": Target("rgba32f", "position in view space, metres, of a drawn sender", "drawn_senders",
                                        exists=gathers_unseen),
              "unseen_power": Target("rgba32f", "radiance times the area that a drawn sender stands for; alpha: its "
                                     "normal in view space", "drawn_senders", exists=gathers_unseen)}
    uniforms = {"side": "int", "random_seed": "int"}

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        yield Dispatch(0, {"side": DRAWN_SIDE, "random_seed": random_seed(frame)})


class UnseenGather(_UnseenPass):
    """Irradiance from unseen senders at the starting level, by rays against the scene's triangles.

    Each ray to a sender goes to one of several candidates, chosen in proportion to what it would bring if nothing were
    in the way. What is closer than senders are to one another is met by a second ray, of random direction.

    Source: Talbot et al. 2005, "Importance resampling for global illumination".
    """

    name = "unseen_gather"
    shader = "passes/unseen_gather.glsl"
    reads = {"surface": Read.of("surface"), **_SHOWN,
             "position": Read.of("unseen_position", offset=None), "power": Read.of("unseen_power", offset=None)}
    tables = _LIGHT
    writes = {"unseen": Target("lobe", "light from surfaces that the image does not show: flux and mean direction",
                               "start", exists=gathers_unseen)}
    uniforms = {"texel": "float", "side": "int", "rays": "int", "candidates": "int", "near_reach": "float",
                **_LIGHT_UNIFORMS}

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        level = frame.settings.start_level
        yield Dispatch(level, {"texel": float(2**level), "side": DRAWN_SIDE, "rays": frame.settings.unseen_samples,
                               "candidates": _CANDIDATES, "near_reach": frame.rays.near, **_light_uniforms(frame)},
                       _light_defines(frame))


def _reflects_unseen(settings: Settings) -> bool:
    return gathers_unseen(settings) and uses_glossy(settings)


class UnseenReflect(_UnseenPass):
    """What glossy surfaces reflect of unseen ones, by rays against the scene's triangles."""

    name = "unseen_reflect"
    shader = "passes/unseen_reflect.glsl"
    reads = {"surface": Read.of("surface"), **_SHOWN,
             "specular": Read.of("specular", offset=None)}
    tables = _LIGHT
    writes = {"unseen_reflection": Target("rgb9e5", "radiance of surfaces that the image does not show, reflected with "
                                          "a reflectance of 1, W m^-2 sr^-1", "start", exists=_reflects_unseen)}
    uniforms = {"texel": "float", "rays": "int", **_LIGHT_UNIFORMS}

    def enabled(self, settings: Settings) -> bool:
        return _reflects_unseen(settings)

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        level = frame.settings.start_level
        yield Dispatch(level, {"texel": float(2**level), "rays": -(-frame.settings.unseen_samples // _RAYS_TO_REFLECT),
                               **_light_uniforms(frame)}, _light_defines(frame))
