"""The window: events in, and the order of one frame."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from ssil_viewer.app import theme
from ssil_viewer.app.actions import Actions
from ssil_viewer.app.diagnosis import LightWatch
from ssil_viewer.app.exposure_choice import ExposureOrigin
from ssil_viewer.app.following import RendererFollower
from ssil_viewer.app.glfw_window import GlfwWindow, open_window
from ssil_viewer.app.gui import Gui
from ssil_viewer.app.imgui_input import ImguiInput
from ssil_viewer.app.imgui_renderer import ImguiRenderer
from ssil_viewer.app.keys import MOVEMENT_KEYS, Chord
from ssil_viewer.app.keys import actions as key_actions
from ssil_viewer.app.pacing import Pacer
from ssil_viewer.app.recent_scenes import RecentScenes
from ssil_viewer.app.scene_loading import SceneLoader
from ssil_viewer.app.state import AppState, PixelReading, ReferenceKind
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

TITLE = "SSIL Viewer"
_MINIMISED_WAIT = 0.1      # s between looks at the events while there is nothing to draw
_IDLE_WAIT = 0.05          # s between redraws of the panels while nothing changes
_DOUBLE_CLICK = 0.35       # s
_CLICK_SLOP = 4.0          # window units that a click may move
_READING_INTERVAL = 0.2    # s; each reading waits for the GPU
_HINT_FRAME = 5            # by then shaders are compiled
_SLOW_FRAME = 0.5          # s
_INSPECTED = ("final", "direct", "indirect", "albedo", "normal", "view_depth")
_COMMAND = (glfw.KEY_LEFT_SUPER, glfw.KEY_RIGHT_SUPER) if sys.platform == "darwin" else ()
_MODIFIERS = {"ctrl": (glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL, *_COMMAND),
              "shift": (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT),
              "alt": (glfw.KEY_LEFT_ALT, glfw.KEY_RIGHT_ALT)}


def run_window(scene: Scene, settings: Settings = Settings(), size: tuple[int, int] = (1280, 720),
               camera: Camera | None = None, frames: int | None = None, vsync: bool = True,
               reference: ReferenceKind = "off", other: Settings | None = None, image_scale: float = 1.0,
               panel_scale: float = 1.0, exposure_is: ExposureOrigin = "chosen", auto_exposure: bool = False,
               recent: RecentScenes | None = None) -> None:
    """Open a window on a scene and return when it is closed.

    Args:
        scene: Shown first; others can be opened in the window.
        size: Of the window.
        camera: First view; None takes the scene's default camera, with what it looks at beside the panel.
        frames: Close by itself after so many frames; None waits for the user.
        vsync: Wait for the monitor.
        reference: What the picture is compared with.
        other: Settings B, shown beside the picture, unless a reference is.
        image_scale: Rendered pixels per pixel of the window, along each side.
        panel_scale: Of text and panels, on top of what the monitor asks for.
        exposure_is: "unchosen": if the scene is seen nearly black or white with that of `settings`, another is taken;
            "of picture": right for this scene alone.
        auto_exposure: One is chosen in any case, by the first picture.
        recent: Scenes opened before, for the menu; None keeps a list of this window alone.

    Raises:
        UserError: There is no display or no fit OpenGL, or the scene cannot be shown.
    """
    window = open_window(TITLE, size, vsync)
    try:
        viewer = Viewer(window, scene, settings, camera, vsync, image_scale, panel_scale)
        viewer.state.other = other
        if recent is not None:
            viewer.actions.recent = recent
        viewer.actions.recent.add(scene.name)
        if exposure_is == "unchosen":
            viewer.actions.exposure.start()
        elif exposure_is == "of picture":
            viewer.actions.exposure.picture_opened()
        if auto_exposure:
            viewer.actions.exposure.ask()
        viewer.actions.set_reference(reference)
        # A number of frames is asked for to measure or to test: then each turn has to be one.
        viewer.state.continuous |= frames is not None
        try:
            while not window.is_closing and (frames is None or viewer.frames < frames):
                viewer.step()
        finally:
            viewer.release()
    finally:
        window.destroy()


class Viewer:
    """Ties window, renderer and panels together.

    Attributes:
        state: What the window remembers.
        frames: Frames drawn so far.
    """

    def __init__(self, window: GlfwWindow, scene: Scene, settings: Settings, camera: Camera | None, vsync: bool,
                 image_scale: float = 1.0, panel_scale: float = 1.0) -> None:
        self._window = window
        self._ctx = window.ctx
        self.frames = 0
        first = camera or default_camera(scene)
        self.state = AppState(settings, scene, first, ui_scale=panel_scale, render_scale=image_scale, vsync=vsync)
        self.state.open_scene(scene, first, camera is not None)
        self._screen = self._ctx.screen
        self._renderer = Renderer(self._ctx, self._render_size(), settings)
        self._renderer.set_scene(scene)
        self._imgui = imgui.create_context()
        imgui.get_io().set_ini_filename("")
        theme.load_font()
        self._style_scale = 0.0
        self._gui_renderer = ImguiRenderer(self._ctx)
        self._input = ImguiInput(window, window.handle, lambda: self._gui.keys_wait)
        self.actions = Actions(self.state, self._renderer, SceneLoader(load_scene, default_camera), self)
        self._follower = RendererFollower(self.state, self._renderer, self.actions)
        self._gui = Gui(self.state, self.actions, self._renderer)
        self.state.continuous = not self._renderer.capabilities.software
        self._pacer = Pacer(self.state.continuous)
        self._key_actions = {self._code(chord): action for chord, action in key_actions().items()}
        self._held: set[int] = set()
        self._drag: int | None = None
        self._cursor = (0.0, 0.0)
        self._cursor_is_known = False
        self._last_click = (-1.0, (0.0, 0.0))
        self._last_reading = 0.0
        self._rendered = False
        self._panel_is_known = False    # how much of the picture it covers
        self._light_watch = LightWatch(self.state, self._renderer)
        self._save_window = False
        self._clock = time.perf_counter()
        self._connect()

    def step(self) -> None:
        """One turn of the loop: a frame, panels over the last frame, or a short sleep while minimised."""
        if self._window.minimised:
            self._window.wait(_MINIMISED_WAIT)
            self._clock = time.perf_counter()
            return
        now = time.perf_counter()
        seconds, self._clock = now - self._clock, now
        self._advance(seconds)
        self._draw_gui(seconds)
        if not self._panel_is_known:
            self._panel_is_known = True
            self.actions.reset_camera()
        reference, follower = self.actions.reference, self._follower
        measuring = self.actions.benchmark.advance()    # then the renderer has settings of its own
        follower.begin_turn()
        if not measuring:
            follower.send(self._render_size())
        self._show_title()
        view = follower.look()
        self._pacer.continuous = self.state.continuous
        if (not measuring and view != follower.broken_view and follower.may_render(view)
                and self._pacer.should_render(now, view, self.state.frame_time, self.state.settings,
                                              *([self.state.other] if self.actions.other.on else []))):
            if self._rendered:
                self.state.frame_seconds.append(seconds)
            self._rendered = True
            follower.render(view)
            self.frames += 1
            if self.frames == _HINT_FRAME and self.state.frame_time > _SLOW_FRAME:
                self.state.say("Frames are slow here: try Settings > fast, or Window > Image scale")
        else:
            self._rendered = False
        self.state.resting = not self._rendered and not measuring
        if not measuring:   # settings that are not in force yet may be refused
            self.actions.note_changes(busy=imgui.is_any_item_active() or self._renderer.settings
                                      != reference.settings(self.state.settings))
        # While settings wait for what they need, the picture may have what a reference cannot have
        comparable = reference.settings(self._renderer.settings) == self._renderer.settings
        if not measuring and comparable and follower.rendered_view is not None:
            reference.follow(follower.rendered_view)
            reference.advance(self.state.continuous or not self._pacer.idle(now), self._rendered)
        self._present(self._screen)
        self._gui_renderer.render(imgui.get_draw_data(), self._screen)
        self._after_frame(view, measuring)
        self._window.swap_buffers()
        if not self._rendered and not measuring and not reference.working and self._pacer.idle(now):
            self._window.wait(_IDLE_WAIT)

    def release(self) -> None:
        """Give everything back that hangs on the OpenGL context."""
        self.actions.benchmark.stop()
        self._follower.release()
        self._gui_renderer.release()
        imgui.destroy_context(self._imgui)
        self.actions.reference.release()
        self.actions.other.release()
        self._renderer.release()

    # What actions need of the window

    def close(self) -> None:
        """End the loop after this frame."""
        self._window.is_closing = True

    def toggle_fullscreen(self) -> None:
        """Full screen on and off."""
        self._window.fullscreen = not self._window.fullscreen

    def set_vsync(self, on: bool) -> None:
        """Wait for the monitor or not."""
        self._window.vsync = on

    def copy_text(self, text: str) -> None:
        """Put text on the clipboard."""
        glfw.set_clipboard_string(self._window.handle, text)

    def save_after_frame(self) -> None:
        """Save the window, panels included, when this frame is drawn."""
        self._save_window = True

    # The parts of a frame

    def _show_title(self) -> None:
        title = f"{self.state.scene_title} - {TITLE}"
        if title != self._window.title:
            self._window.title = title

    def _advance(self, seconds: float) -> None:
        self.actions.poll_loader()
        self.state.motion = self.state.motion.advanced(seconds)
        if self.state.camera.mode == "fly" and not self._held_modifier("ctrl") and not self._keys_are_taken():
            steps = [step for name, step in MOVEMENT_KEYS.items() if getattr(self._window.keys, name) in self._held]
            self.state.camera.fly(*(sum(axis) for axis in zip((0, 0, 0), *steps)), seconds=seconds,
                                  fast=self._held_modifier("shift"))

    def _draw_gui(self, seconds: float) -> None:
        scale = self.state.ui_scale * self._window.content_scale
        if scale != self._style_scale:
            theme.apply(scale)
            self._style_scale = scale
        self._input.begin_frame(seconds)
        imgui.new_frame()
        self._gui.draw()
        imgui.render()

    def _after_frame(self, view: Any, measuring: bool) -> None:
        if self._save_window:
            self._save_window = False
            self.actions.save_pixels(self._window_pixels())
        if measuring or self._follower.rendered_view is None:
            return      # what follows reads back, which would disturb every frame, and needs one
        if self._follower.rendered_view == view and not self.state.preparing:
            self.actions.exposure.frame_shown()
        now = time.monotonic()
        if self.state.inspector and now - self._last_reading > _READING_INTERVAL:
            self._last_reading = now
            try:
                self.state.pixel = self._read_pixel()
            except (UserError, ShaderError) as error:
                self.state.pixel, self.state.inspector = None, False
                self.state.say(str(error), "error")
        self._light_watch.look(now, view, self._follower.lights)

    def _window_pixels(self) -> np.ndarray:
        """(H, W, 3) uint8, row 0 = top: what the window shows, drawn once more where it can be read."""
        width, height = self._window.buffer_size
        target = self._ctx.simple_framebuffer((width, height), 4)
        self._present(target)
        self._gui_renderer.render(imgui.get_draw_data(), target)
        pixels = np.frombuffer(target.read(components=3, alignment=1), np.uint8).reshape(height, width, 3)[::-1]
        self._screen.use()
        target.color_attachments[0].release()
        target.release()
        return pixels

    def _present(self, framebuffer: moderngl.Framebuffer) -> None:
        if self._follower.rendered_view is None:
            framebuffer.clear()     # before the first frame
            return
        self._renderer.present(framebuffer)
        if not self.actions.benchmark.running:
            self.actions.reference.present(framebuffer)
            self.actions.other.present(framebuffer)

    def _read_pixel(self) -> PixelReading | None:
        if imgui.get_io().want_capture_mouse:
            return None
        u, v = self._cursor[0] / self._window.width, self._cursor[1] / self._window.height
        if not (0.0 <= u < 1.0 and 0.0 <= v < 1.0):
            return None
        buffers, values = self._renderer.buffers(), {}
        wanted = [(self.state.buffer, self.state.level)] if self.state.buffer else [
            (name, buffers[name].levels[0]) for name in _INSPECTED if name in buffers]
        for name, level in wanted:
            data = np.atleast_3d(self._renderer.read(name, level))
            pixel = data[int(v * data.shape[0]), int(u * data.shape[1])]
            values[f"{name}@{level}" if level else name] = tuple(float(x) for x in pixel)
        width, height = self._renderer.size
        return PixelReading(int(u * width), int(v * height), values)

    def _render_size(self) -> tuple[int, int]:
        width, height = self._window.buffer_size
        scale = self.state.render_scale
        return max(round(width * scale), 1), max(round(height * scale), 1)

    # Events

    def _connect(self) -> None:
        window = self._window
        window.key_event_func = self._on_key
        window.unicode_char_entered_func = self._input.character
        window.mouse_position_event_func = self._on_move
        window.mouse_drag_event_func = self._on_move
        window.mouse_press_event_func = self._on_press
        window.mouse_release_event_func = self._on_release
        window.mouse_scroll_event_func = self._on_wheel
        window.resize_func = self._on_resize
        window.dropped = self._on_drop
        window.refused = lambda text: self.state.say(text, "error")

    def _code(self, chord: Chord) -> tuple[int, bool, bool]:
        return getattr(self._window.keys, chord.key), chord.ctrl, chord.shift

    def _held_modifier(self, name: str) -> bool:
        return any(key in self._held for key in _MODIFIERS[name])

    def _keys_are_taken(self) -> bool:
        """Whether a text field or a box that everything else waits for has the keyboard."""
        return imgui.get_io().want_text_input or self._gui.has_modal

    def _on_key(self, key: int, action: int, modifiers: Any) -> None:
        self._pacer.event(time.perf_counter())
        keys = self._window.keys
        down = action != keys.ACTION_RELEASE
        (self._held.add if down else self._held.discard)(key)
        ctrl, shift, alt = (self._held_modifier(name) for name in ("ctrl", "shift", "alt"))
        labelled = self._window.labelled(key)
        self._input.key(labelled, down, ctrl, shift, alt)
        if action != keys.ACTION_PRESS or self._keys_are_taken() or alt:    # with AltGr keys write other characters
            return
        flying = self.state.camera.mode == "fly" and not ctrl
        if flying and key in (getattr(keys, name) for name in MOVEMENT_KEYS):
            return
        name, digit = self._key_actions.get((labelled, ctrl, shift), ("", None))
        if name:
            getattr(self.actions, name)(*([digit] if digit is not None else []))

    def _on_move(self, x: float, y: float, dx: float, dy: float) -> None:
        self._pacer.event(time.perf_counter())
        # The window reports whole units; the drag is taken from positions, so that nothing is lost.
        dx, dy = x - self._cursor[0], y - self._cursor[1]
        self._cursor, self._cursor_is_known = (x, y), True
        self._input.move(x, y)
        if self._drag is None:
            return
        mouse, camera = self._window.mouse, self.state.camera
        dx, dy = dx / self._window.height, dy / self._window.height
        if self._drag == mouse.middle or (self._drag == mouse.left and self._held_modifier("shift")
                                          and camera.mode == "orbit"):
            camera.pan(dx, dy)
        elif self._drag == mouse.right:
            camera.look(dx, dy)
        else:
            camera.rotate(dx, dy)

    def _on_press(self, x: float, y: float, button: int) -> None:
        self._pacer.event(time.perf_counter())
        # Where the mouse is now, not where the button went down: after a slow frame that is where a quick drag ended
        if not self._cursor_is_known:
            self._cursor, self._cursor_is_known = (x, y), True
        x, y = self._cursor
        self._input.move(x, y)
        self._input.button(button, True)
        if self._input.is_over(x, y):
            return
        self._drag = button
        if button != self._window.mouse.left:
            return
        now, (then, place) = time.monotonic(), self._last_click
        near = max(abs(x - place[0]), abs(y - place[1])) <= _CLICK_SLOP
        self._last_click = (now, (x, y))
        if near and now - then < _DOUBLE_CLICK:
            self.actions.focus_pixel(x / self._window.width, y / self._window.height)

    def _on_release(self, x: float, y: float, button: int) -> None:
        self._pacer.event(time.perf_counter())
        self._input.button(button, False)
        if button == self._drag:
            self._drag = None

    def _on_wheel(self, x: float, y: float) -> None:
        self._pacer.event(time.perf_counter())
        self._input.wheel(x, y)
        if not self._input.is_over(*self._cursor):
            self.state.camera.wheel(y)

    def _on_resize(self, width: int, height: int) -> None:
        if width > 0 and height > 0:
            self._screen.viewport = (0, 0, width, height)

    def _on_drop(self, paths: list[Path]) -> None:
        for path in paths:
            self.actions.open_path(path)
