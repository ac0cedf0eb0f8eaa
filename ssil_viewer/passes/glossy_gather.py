"""The indirect light that glossy surfaces reflect, of each level."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass, switch
from ssil_viewer.scene.model import Material, Scene
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame

# From here on a dielectric's reflection fades (shaders/passes/gbuffer.frag.glsl), and materials count as diffuse
_DIFFUSE_ROUGHNESS = 0.8

GLOSSY = frozenset({"glossy"})
"""The feature of scenes of which anything may reflect."""

# Share of the radius at which a level begins to give way to the next. Measured at 960x540, roughness 0.3: the
# reflection of uniform light wavers by 4 %; by 15 % with rings that meet sharply
_FADE = 0.6


def glossy_exists(settings: Settings) -> bool:
    """Whether the targets of glossy reflection are allocated."""
    return settings.glossy_samples > 0


def uses_glossy(settings: Settings) -> bool:
    """Whether glossy reflection is part of the picture."""
    return settings.glossy_samples > 0 and settings.bounces > 0


def is_glossy(material: Material) -> bool:
    """Whether any of the material may reflect: a metal, or a dielectric that is not rough. Textures only lessen the
    factors of metalness and roughness."""
    smooth = material.roughness < _DIFFUSE_ROUGHNESS or material.metallic_roughness_texture is not None
    return material.metallic > 0 or (smooth and material.specular > 0 and material.ior != 1.0)


def has_glossy(scene: Scene) -> bool:
    """Whether any material of the scene may reflect."""
    return any(is_glossy(material) for material in scene.materials)


class GlossyGather(ScreenPass):
    """Monte-Carlo estimate of the radiance that a reflectance of 1 sends to the camera, for each level.

    Lobe: Phong's, normalized over the hemisphere. Samples lie in the wedge of the image that a cone around the mirror
    direction fills, and stand for so much less each.

    Source: Soler et al. 2010, "importance sampling". Differs: the lobe widens to the size of the sender's texel, and
    the wedge by so much (docs/method/glossy.md).
    """

    name = "glossy_gather"
    shader = "passes/glossy_gather.glsl"
    reads = {"surface": Read.of("surface"), "radiance": Read.of("radiance"),
             "image_surface": Read.of("surface", offset=None), "specular": Read.of("specular", offset=None),
             "unseen": Read.of("unseen_reflection", optional=True),
             "voxels": Read.of("voxels", optional=True), "voxels_far": Read.of("voxels_far", optional=True),
             "depth_range": Read.of("depth_range", offset=None, optional=True)}
    writes = {"glossy_gather": Target("reflection", "radiance reflected from this level's disc or ring for a "
                                      "reflectance of 1, W m^-2 sr^-1, and roughness; -1 where nothing reflects",
                                      "gather", exists=glossy_exists)}
    uniforms = {"texel": "float", "inner_radius": "float", "fade": "vec2", "samples": "int", "directions": "int",
                "steps": "int"}

    def settings_for(self, scene: Scene, settings: Settings) -> Settings:
        return settings if has_glossy(scene) else replace(settings, glossy_samples=0)

    def enabled(self, settings: Settings) -> bool:
        return uses_glossy(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        settings = frame.settings
        chosen = (switch("FORM_FACTOR", settings.form_factor, ("disc", "point")),
                  switch("SPACING", settings.sample_spacing, ("radius", "area")),
                  switch("VISIBILITY", settings.visibility, ("off", "voxel", "horizon")),
                  ("SLICES", str(settings.voxel_slices)), ("IMPORTANCE", str(int(settings.importance_sampling))))
        unread = {"voxels", "voxels_far", "depth_range"}
        if settings.visibility == "voxel":
            unread = {"voxels_far"} if settings.voxel_slices == 128 else set()
        # Few rows with many samples each: a narrow wedge has no room for more. The same without importance sampling,
        # since what blocks light is found the better the closer samples follow one another.
        steps = min(math.isqrt(4 * settings.glossy_samples), settings.glossy_samples)
        rows = {"directions": settings.glossy_samples // steps, "steps": steps}
        radius, first, last = frame.radius, settings.start_level, settings.last_level
        for level in range(first, last + 1):
            # A level fades out from _FADE of its radius on, and the next one, whose texels are twice as wide, fades in
            fade_in = 0.0 if level == first else 1.0 / (0.5 * (1.0 - _FADE) * radius)
            fade_out = 0.0 if level == last else 1.0 / ((1.0 - _FADE) * radius)
            yield Dispatch(level, {"texel": float(2**level), "inner_radius": 0.0 if level == first else
                                   0.5 * _FADE * radius, "fade": (fade_in, fade_out),
                                   "samples": settings.glossy_samples, **rows}, chosen,
                           frozenset(unread if frame.has_target("unseen_reflection", level) else unread | {"unseen"}),
                           alone=level < last)
