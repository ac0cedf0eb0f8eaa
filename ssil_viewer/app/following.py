"""The renderer follows the state: before each frame it is told what has changed, and what it refuses is taken back."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.preparation import Preparation
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Light
from ssil_viewer.settings import Settings


class RendererFollower:
    """Sends the state to the renderer, draws frames, and tells errors in the window.

    Args:
        state: What is wanted. Values that the renderer refuses go back to those that it took last.
        renderer: Made with the settings of the state, and with its scene.
        actions: What the picture depends on beside: reference, benchmark, settings B.

    Attributes:
        lights: What the renderer has, in motion.
        rendered_view: What the last frame shows, as `look` has it; None before the first.
        broken_view: What cannot be drawn, since its shaders do not compile, or None.
    """

    def __init__(self, state: AppState, renderer: Renderer, actions: Actions) -> None:
        self._state, self._renderer, self._actions = state, renderer, actions
        self._preparation = Preparation(state, renderer)
        self.lights: tuple[Light, ...] = state.lights
        self.rendered_view: Any = None
        self.broken_view: Any = None
        self._sent_settings = state.settings
        self._sent_buffer: tuple[str | None, int] = (None, 0)
        self._refused_size: Any = None        # with the settings under which it was refused
        self._shown: tuple[Settings, str | None, int] | None = None   # of the last frame without an error

    def begin_turn(self) -> None:
        """Call it once a turn of the window."""
        self._preparation.begin_turn()

    def send(self, size: tuple[int, int], at_once: bool = False) -> None:
        """Bring the renderer to the state; what it refuses is taken back and reported. Call it once a turn.

        Args:
            size: Width and height to render, in pixels.
            at_once: Settings need no preparation. Otherwise the old ones stay until theirs is done.
        """
        state, renderer, preparation = self._state, self._renderer, self._preparation
        self._resize(size)
        wanted = self._actions.reference.settings(state.settings)
        try:
            if renderer.settings != wanted and (at_once or preparation.ready(wanted)):
                renderer.set_settings(wanted, preparation.ray_tables)
            if renderer.settings == wanted:
                preparation.settled()
                self._sent_settings = state.settings
        except UserError as error:
            state.say(str(error), "error")
            state.settings, state.reference = self._sent_settings, "off"
        try:
            renderer.set_environment(state.scene.environment)
        except UserError as error:
            state.say(str(error), "error")
            state.scene = replace(state.scene, environment=renderer.environment)
        lights = state.motion.applied(state.lights)
        # Another name changes nothing in the picture
        if lights != self.lights and _unnamed(lights) != _unnamed(self.lights):
            renderer.set_lights(lights)
            self.lights = lights
        self._send_buffer()
        if state.camera.jumped:
            renderer.reset_history()
            state.camera.jumped = False

    def _resize(self, size: tuple[int, int]) -> None:
        renderer = self._renderer
        asked = size, renderer.settings
        if size == renderer.size:
            self._refused_size = None
        elif asked != self._refused_size:
            try:
                renderer.resize(size)
            except UserError as error:
                self._refused_size = asked
                self._state.say(str(error), "error")

    def _send_buffer(self) -> None:
        state, renderer = self._state, self._renderer
        self._actions.keep_buffer_valid()
        if (state.buffer, state.level) != self._sent_buffer:
            try:
                renderer.show_buffer(state.buffer, state.level)
            except UserError as error:
                state.say(str(error), "error")
                state.buffer, state.level = None, 0
                renderer.show_buffer(None)
            self._sent_buffer = (state.buffer, state.level)

    def look(self) -> Any:
        """Everything that the picture depends on."""
        state = self._state
        return (self._renderer.settings, self.lights, self._sent_buffer, self._renderer.size, state.camera.camera(),
                state.scene, state.shader_generation, self._actions.benchmark.runs,
                state.other if self._actions.other.on else None)

    def may_render(self, view: Any) -> bool:
        """Whether the next frame can begin: one that compiles waits for a message about it. Call it once a turn.

        Args:
            view: What it would show, as `look` has it.
        """
        if self._preparation.waiting and self._renderer.capabilities.software and view == self.rendered_view:
            return False    # the cores are needed for what is prepared
        return self._preparation.may_render(self._actions.other.lacks_something)

    def render(self, view: Any) -> None:
        """One frame of what `look` answers; after an error the last picture stays, or is drawn again.

        Raises:
            ShaderError: In the first frame, which has none before it to go back to.
        """
        state, renderer = self._state, self._renderer
        self._actions.other.render(state.camera.camera())
        try:
            renderer.render(state.camera.camera())
            self._shown = (self._sent_settings, state.buffer, state.level)
            self.rendered_view = view
        except UserError as error:  # no memory for shadow maps, for one
            state.say(str(error), "error")
        except ShaderError as error:
            if self._shown is None:
                raise
            state.shader_error = str(error)
            if self._shown == (self._sent_settings, state.buffer, state.level):
                self.broken_view = view   # not the settings' doing, so wait for another view
                return
            state.settings, state.buffer, state.level = self._shown
            # New targets are empty: fill them before they are seen.
            self.send(renderer.size, at_once=True)
            try:
                renderer.render(state.camera.camera())
            except (UserError, ShaderError):
                self.broken_view = self.look()
        finally:
            self._preparation.rendered()

    def release(self) -> None:
        """Return when nothing works for it in a thread any more."""
        self._preparation.release()


def _unnamed(lights: tuple[Light, ...]) -> list[Light]:
    return [replace(light, name="") for light in lights]
