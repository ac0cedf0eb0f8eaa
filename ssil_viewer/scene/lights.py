"""Lights of a scene as a whole: whether anything shines, and a sun for scenes where nothing does."""

from __future__ import annotations

import math
from dataclasses import replace

from ssil_viewer.scene.model import Light, Scene

SUN_NAME = "default sun"

SUN_ADDED = "nothing in the scene shines, so a default sun was added"
"""The warning of a scene that has been given it."""

SUN_ELEVATION = math.radians(72.0)
"""High enough to reach the floor of a courtyard as deep as it is wide."""

SUN_SKEW = math.radians(35.0)
"""Angle between the sun's horizontal direction and the longer side of the scene."""

SUN_IRRADIANCE = 3.0 * math.pi
"""W m^-2 at normal incidence: white Lambertian ground under this sun then has radiance 2.9."""

SKY_RADIANCE = (0.35, 0.45, 0.6)
"""The backdrop of scenes lit by the default sun: a soft blue, darker than what the sun lights."""


def shines(scene: Scene) -> bool:
    """Whether the scene has a light, an environment, or a surface that emits."""
    used = {primitive.material for mesh in scene.meshes for primitive in mesh.primitives}
    emits = any(max(scene.materials[index].emission) > 0.0 for index in used)
    return bool(scene.lights) or scene.environment is not None or emits


def with_default_light(scene: Scene) -> Scene:
    """The scene itself when something in it shines, else with a sun, a backdrop unless it has one, and a warning."""
    if shines(scene):
        return scene
    horizontal = math.cos(SUN_ELEVATION)
    low, high = scene.bounds()
    along_x = high[0] - low[0] > high[2] - low[2]
    # From behind a viewer who looks along -Z where the scene has no longer side to go by
    azimuth = math.pi / 2 - SUN_SKEW if along_x else SUN_SKEW
    sun = Light(
        kind="directional",
        name=SUN_NAME,
        intensity=SUN_IRRADIANCE,
        direction=(
            -horizontal * math.sin(azimuth),
            -math.sin(SUN_ELEVATION),
            -horizontal * math.cos(azimuth),
        ),
    )
    sky = scene.background if any(scene.background) else SKY_RADIANCE
    return replace(scene, lights=(sun,), background=sky, warnings=(*scene.warnings, SUN_ADDED))


def without_default_light(lights: tuple[Light, ...]) -> tuple[Light, ...]:
    """The lights without the sun that `with_default_light` adds: whoever brings light of another kind needs none."""
    return tuple(light for light in lights if not (light.kind == "directional" and light.name == SUN_NAME))
