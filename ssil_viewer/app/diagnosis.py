"""Answers the question that users of screen-space light ask most: why do I see none?"""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np

from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Light, Scene
from ssil_viewer.settings import Settings

_SETTLED = 0.7      # s without a change before the picture is looked at for light


class LightWatch:
    """Looks, once after every change, whether anything in view is lit, and tells the state why there is no light."""

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self._last_view: Any = None
        self._changed_at: float | None = None
        self._lit: bool | None = None

    def look(self, now: float, view: Any, lights: Sequence[Light]) -> None:
        """Once a turn.

        Args:
            now: Seconds.
            view: Everything that the picture depends on.
            lights: As the renderer has them.
        """
        state = self._state
        if view != self._last_view:
            self._last_view, self._changed_at, self._lit = view, now, None
        elif self._changed_at is not None and now - self._changed_at > _SETTLED:
            self._changed_at = None
            buffers = self._renderer.buffers()
            if "radiance" in buffers and state.settings.bounces:
                try:
                    self._lit = bool(np.any(self._renderer.read("radiance", buffers["radiance"].levels[-1]) > 0.0))
                except (UserError, ShaderError) as error:
                    state.say(str(error), "error")
        state.no_indirect = why_no_indirect(state.settings, state.scene, lights, self._lit)


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
