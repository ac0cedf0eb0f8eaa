"""Two sets of settings side by side: the window's own, A, and another, B, kept before. One camera, scene and light.

B has a renderer of its own while it is on, with its own copy of the scene, so that neither disturbs the other's history
or times.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import moderngl
import numpy as np

from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.headless import read_display
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera
from ssil_viewer.settings import Settings, knobs, of_display


class OtherSettings:
    """The renderer of settings B. `AppState.other` holds them; None is off."""

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state, self._ours = state, renderer
        self._other: Renderer | None = None
        self._shader_generation = 0
        self._rendered = False

    @property
    def on(self) -> bool:
        """Whether B is to be shown; a reference goes before it."""
        return self._state.other is not None and self._state.reference == "off"

    @property
    def shown(self) -> bool:
        """Whether the window shows B."""
        return self.on and self._rendered

    @property
    def lacks_something(self) -> bool:
        """Whether B's next frame takes long, since it makes B's renderer, or what new settings of it need."""
        if not self.on or self._other is None or self._other.scene is not self._ours.scene:
            return self.on
        wanted = with_display_of(self._state.other, self._state.settings)
        return self._other.settings != wanted and bool(self._other.missing(wanted))

    def differences(self) -> list[tuple[str, Any, Any]]:
        """Name, value in A and value in B of the settings that differ."""
        a = self._state.settings
        b = with_display_of(self._state.other or a, a)
        return [(info.name, getattr(a, info.name), getattr(b, info.name)) for info in knobs()
                if getattr(a, info.name) != getattr(b, info.name)]

    @property
    def milliseconds(self) -> tuple[float, float] | None:
        """What all passes of A and of B take, medians; None until both are measured."""
        if self._other is None:
            return None
        sums = []
        for renderer in (self._ours, self._other):
            times = [time.median_ms for time in renderer.timings.passes.values() if time.count]
            if not times:
                return None
            sums.append(sum(times))
        return sums[0], sums[1]

    def render(self, camera: Camera) -> None:
        """A frame of B, before one of A: what A binds must be bound last. Gives up with a message on any error."""
        if not self.on:
            self.release()
            return
        try:
            other = self._follow()
            if self._ours.frame_index == 0:     # A begins anew, so both have as many frames in their mean
                other.reset_history()
            other.render(camera)
            self._rendered = True
        except (UserError, ShaderError) as error:
            self._state.other = None
            self._state.say(str(error), "error")
            self.release()

    def _follow(self) -> Renderer:
        """B's renderer, with A's scene, light, size and display."""
        state, ours = self._state, self._ours
        wanted = with_display_of(state.other, state.settings)
        if self._other is None:
            self._other = Renderer(ours.context, ours.size, wanted)
            self._shader_generation = state.shader_generation
        other = self._other
        if other.scene is not ours.scene:
            other.set_scene(ours.scene)
        other.resize(ours.size)
        if other.settings != wanted:
            other.set_settings(wanted)
        other.set_environment(ours.environment)
        if other.lights != ours.lights:
            other.set_lights(ours.lights)
        if self._shader_generation != state.shader_generation:
            self._shader_generation = state.shader_generation
            other.reload_shaders()      # what is wrong with them is said for A
        name = state.buffer if state.buffer in other.buffers() else None
        levels = other.buffers()[name].levels if name else range(1)
        other.show_buffer(name, min(max(state.level, levels[0]), levels[-1]))
        return other

    def present(self, framebuffer: moderngl.Framebuffer) -> None:
        """Draw B right of the divider."""
        if self.shown:
            self._ours.present(framebuffer, self._other.display, self._state.split)

    def read(self) -> np.ndarray:
        """The picture as it is shown, in the rendered size: (H, W, 3) uint8, row 0 = top."""
        ours, theirs = read_display(self._ours), read_display(self._other)
        column = round(self._state.split * ours.shape[1])
        return np.concatenate([ours[:, :column], theirs[:, column:]], 1)

    def release(self) -> None:
        """Free B's GPU memory."""
        if self._other is not None:
            self._other.release()
            self._other = None
        self._rendered = False


def with_display_of(settings: Settings, display: Settings) -> Settings:
    """Settings with what concerns the display alone of others: what is compared is shown alike."""
    return replace(settings, **of_display(display))
