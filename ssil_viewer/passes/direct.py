"""Direct lighting."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.light_table import LIGHT_TABLES
from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame


class Direct(ScreenPass):
    """Light from points, spots, the sun, areas and the environment with shadows, and emission.

    Diffuse: Lambert. Highlights: GGX (Walter et al. 2007); of areas from a representative point, of the environment
    from its map blurred by roughness (Karis 2013). Only the diffuse part and emission go into the radiance that the
    gather reads. What `ShadowRays` has found stands in for the shadow map.
    """

    name = "direct"
    shader = "passes/direct.glsl"
    reads = {"surface": Read.of("surface"), "albedo": Read.of("albedo"), "specular": Read.of("specular"),
             "emission": Read.of("emission"), "sky": Read.of("sky", offset="start", optional=True),
             "start_surface": Read.of("surface", offset="start", optional=True),
             "motion": Read.of("motion"), "traced": Read.of("traced", optional=True),
             "previous_surface": Read.of("surface@previous", optional=True),
             "history": Read.of("irradiance@previous", optional=True)}
    tables = {**LIGHT_TABLES, "environment": "sampler2D", "environment_irradiance": "sampler2D",
              "environment_specular": "sampler2D"}
    writes = {
        "direct": Target("rgb9e5", "radiance towards the camera from direct light and emission, W m^-2 sr^-1; "
                                   "background: the backdrop"),
        "radiance": Target("rgb9e5", "diffuse exitant radiance L = emission + albedo / pi * E_direct, W m^-2 sr^-1",
                           "pyramid"),
    }
    uniforms = {"start_texel": "float", "punctual_lights": "int"}

    def dispatches(self, frame: SceneFrame) -> Iterable[Dispatch]:
        uniforms = {"start_texel": float(2**frame.settings.start_level),
                    "punctual_lights": frame.lights.punctual_count}
        defines = tuple((f"AREA_{kind.upper()}", "") for kind in frame.lights.area_kinds)
        omit = set() if frame.has_feature("environment") else {"sky", "start_surface"}
        if frame.rays_are_stale or not frame.has_target("traced", 0):
            omit.add("traced")
        if not frame.settings.feeds_back:
            omit |= {"previous_surface", "history"}
        yield Dispatch(0, uniforms, defines, frozenset(omit))
