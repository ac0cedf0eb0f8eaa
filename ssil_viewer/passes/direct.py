"""Direct lighting."""

from __future__ import annotations

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Read, ScreenPass


class Direct(ScreenPass):
    """Light from point, spot and directional lights with shadows, and emission.

    Diffuse: Lambert. Highlights: GGX (Walter et al. 2007). Only the diffuse part and emission go into the radiance
    that the gather reads.
    """

    name = "direct"
    shader = "passes/direct.glsl"
    reads = {"surface": Read.of("surface"), "albedo": Read.of("albedo"), "specular": Read.of("specular"),
             "emission": Read.of("emission")}
    tables = {"lights": "sampler2D", "shadow_tiles": "sampler2D", "shadow_atlas": "sampler2DShadow"}
    writes = {
        "direct": Target("rgba16f", "radiance towards the camera from direct light and emission, W m^-2 sr^-1; "
                                    "background: the backdrop"),
        "radiance": Target("rgb9e5", "diffuse exitant radiance L = emission + albedo / pi * E_direct, W m^-2 sr^-1",
                           "pyramid"),
    }
