"""Answers the question that users of screen-space light ask most: why do I see none?"""

from __future__ import annotations

from typing import Sequence

from ssil_viewer.scene.model import Light, Scene
from ssil_viewer.settings import Settings


def why_no_indirect(settings: Settings, scene: Scene, lights: Sequence[Light], lit: bool | None = None) -> str:
    """One sentence that says why no indirect light is to be seen, or nothing.

    Args:
        lights: The lights as they are now, not as the scene has them.
        lit: Whether any visible surface has radiance; None when nobody looked.
    """
    if settings.bounces == 0:
        return "No indirect light: bounces is 0"
    if settings.show == "direct":
        return "No indirect light: only direct light is shown (press B)"
    if not scene.instances:
        return "No indirect light: the scene has no surfaces"
    if not any(_shines(light) for light in lights) and not _emits(scene):
        return "No indirect light: no light shines, no material emits and there is no environment"
    if lit is False:
        return "No indirect light: nothing in view is lit, and light can only come from what is in view"
    return ""


def _shines(light: Light) -> bool:
    return light.intensity > 0.0 and max(light.color) > 0.0


def _emits(scene: Scene) -> bool:
    return scene.environment is not None or any(max(material.emission) > 0.0 for material in scene.materials)
