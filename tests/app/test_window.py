"""The real window under Xvfb, driven by real X events through xdotool."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from typing import get_args

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from ssil_viewer.app.panels import widgets
from ssil_viewer.app.window import run_window
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Light, LightKind
from ssil_viewer.settings import Settings, load_preset, of_display
from tests.app.driving import (
    IMAGE_POINT,
    NEEDS_X,
    SETTINGS,
    SIZE,
    click,
    drag,
    on_screen,
    picture,
    turn,
    until,
    windows,
    xdotool,
)

pytestmark = NEEDS_X


def test_a_slider_changes_the_settings_and_a_right_click_resets_them(places, viewer):
    turn(viewer)
    left, top, right, bottom = places["samples"]
    y = (top + bottom) / 2
    drag(viewer, (left + 5, y), (right - 2, y))
    assert viewer.state.settings.samples > 500
    assert viewer._renderer.settings == viewer.state.settings
    click(viewer, ((left + right) / 2, y), button=3)
    assert viewer.state.settings.samples == Settings().samples


def test_a_tooltip_goes_while_its_slider_is_dragged(places, viewer):
    def shown():
        return any("Tooltip" in name for name in windows())

    turn(viewer)
    left, top, right, bottom = places["samples"]
    xdotool(viewer, "mousemove", round((left + right) / 2), round((top + bottom) / 2))
    until(viewer, shown)
    xdotool(viewer, "mousedown", 1)
    xdotool(viewer, "mousemove_relative", 3, 0)
    time.sleep(0.5)
    turn(viewer)
    assert not shown()
    xdotool(viewer, "mouseup", 1)
    until(viewer, shown)


def test_a_typed_value_out_of_range_is_refused_with_a_message(places, viewer):
    turn(viewer)
    left, top, right, bottom = places["samples"]
    subprocess.run(["xdotool", "keydown", "ctrl"], check=True)
    click(viewer, ((left + right) / 2, (top + bottom) / 2))
    subprocess.run(["xdotool", "keyup", "ctrl"], check=True)
    xdotool(viewer, "key", "ctrl+a")
    for key in ("5", "0", "0", "0", "Return"):
        xdotool(viewer, "key", key)
    assert viewer.state.settings.samples == SETTINGS.samples
    assert any("samples cannot be 5000" in toast.text and toast.kind == "error" for toast in viewer.state.toasts)


def test_presets_leave_what_concerns_the_display(viewer):
    changed = {"antialias": False, "exposure": 1.5, "tone_map": "linear", "show": "indirect", "voxel_view_slice": 7}
    viewer.state.settings = viewer.state.settings.replaced(changed)
    viewer.actions.use_preset("fast")
    assert viewer.state.settings == load_preset("fast").replaced(changed)
    assert set(changed) == set(of_display(Settings())), "a new one belongs in here"


def test_keys_choose_the_light_that_is_shown(viewer):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    both = picture(viewer)
    for key, mode in (("d", "direct"), ("i", "indirect")):
        xdotool(viewer, "key", key)
        assert viewer.state.settings.show == viewer._renderer.settings.show == mode
        assert np.abs(picture(viewer) - both).mean() > 2.0
    xdotool(viewer, "key", "b")
    assert viewer.state.settings.show == "both"


def test_the_mouse_turns_and_zooms_the_camera_but_not_through_the_panel(viewer):
    camera = viewer.state.camera
    target, eye = camera.target.copy(), camera.eye.copy()
    drag(viewer, (60, 300), (160, 320))
    assert camera.eye == pytest.approx(eye)
    drag(viewer, IMAGE_POINT, (IMAGE_POINT[0] + 60, IMAGE_POINT[1] + 20))
    assert camera.target == pytest.approx(target, abs=1e-6)
    assert np.linalg.norm(camera.eye - eye) > 0.1
    distance = camera.distance
    xdotool(viewer, "click", 4)
    assert camera.distance < distance
    drag(viewer, IMAGE_POINT, (IMAGE_POINT[0] + 60, IMAGE_POINT[1]), button=2)
    assert np.linalg.norm(camera.target - target) > 0.1


def test_flying_moves_with_held_keys_and_digits_bring_the_view_back(viewer):
    camera = viewer.state.camera
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "ctrl+5")
    eye = camera.eye.copy()
    xdotool(viewer, "key", "c")
    xdotool(viewer, "keydown", "w")
    xdotool(viewer, "keyup", "w")
    moved = camera.eye - eye
    assert np.linalg.norm(moved) > 0.0 and moved / np.linalg.norm(moved) @ camera.forward == pytest.approx(1.0)
    stopped = camera.eye.copy()
    turn(viewer)
    assert camera.eye == pytest.approx(stopped)
    xdotool(viewer, "key", "d")
    assert viewer.state.settings.show == "both"
    xdotool(viewer, "key", "5")
    assert camera.eye == pytest.approx(eye)


def test_a_drag_within_one_slow_frame_turns_the_camera(viewer):
    """When events are handled late, a press is reported with the place where the mouse is by then."""
    camera, window = viewer.state.camera, viewer.window
    forward = camera.forward.copy()
    end = IMAGE_POINT[0] + 80, IMAGE_POINT[1]
    viewer._on_move(*IMAGE_POINT, 0, 0)
    turn(viewer)
    viewer._on_press(*end, window.mouse.left)
    viewer._on_move(*end, 80, 0)
    viewer._on_release(*end, window.mouse.left)
    assert camera.forward @ forward == pytest.approx(np.cos(80 / window.height * np.pi), abs=1e-3)


def test_a_press_goes_to_what_is_where_it_happens(viewer):
    """Within one slow frame the mouse may come from the image to a panel and press there, or the other way around."""
    camera, window, panel = viewer.state.camera, viewer.window, (60, 300)
    for start, place, turns in ((IMAGE_POINT, panel, False), (panel, IMAGE_POINT, True)):
        eye = camera.eye.copy()
        viewer._on_move(*start, 0, 0)
        turn(viewer)
        viewer._on_move(*place, 0, 0)
        viewer._on_press(*place, window.mouse.left)
        viewer._on_move(place[0] + 30, place[1], 30, 0)
        viewer._on_release(place[0] + 30, place[1], window.mouse.left)
        assert (np.linalg.norm(camera.eye - eye) > 0.01) == turns
        turn(viewer)


def test_a_double_click_looks_at_the_surface_under_the_cursor(viewer):
    camera = viewer.state.camera
    eye = camera.eye.copy()
    for _ in range(2):
        viewer._on_press(*IMAGE_POINT, viewer.window.mouse.left)
        viewer._on_release(*IMAGE_POINT, viewer.window.mouse.left)
    turn(viewer)
    assert camera.eye == pytest.approx(eye)
    depth = viewer._renderer.read("view_depth")
    assert depth[SIZE[1] // 4, SIZE[0] // 4] == pytest.approx(camera.distance, rel=0.02)


def test_resizing_follows_the_framebuffer(viewer, tmp_path):
    viewer.state.render_scale = 1.0
    for size in ((500, 300), (701, 411)):
        viewer.window.size = size
        until(viewer, lambda size=size: viewer.window.buffer_size == size)
        turn(viewer)
        assert viewer._renderer.size == size
        viewer.actions.save_window()
        turn(viewer, 1)
        newest = max(tmp_path.glob("*.png"), key=lambda path: (path.stat().st_mtime_ns, path.name))
        image = np.asarray(Image.open(newest)).astype(int)
        assert image.shape[:2] == size[::-1]
        assert image[size[1] - 3, size[0] // 2].max() < 60      # the status line is at the new bottom
        x, y = size[0] - 60, 100                                # above the message about the last picture
        assert np.abs(image[y, x] - picture(viewer)[y, x]).max() < 16
    viewer.state.render_scale = 0.5
    turn(viewer)
    assert viewer._renderer.size == (350, 206)


@pytest.mark.parametrize("size", [(900, 600), (420, 300)])
def test_the_screen_shows_the_whole_picture_after_resizing(viewer, size):
    """What is on the screen, not what is saved: a file has a framebuffer of its own."""
    viewer.state.render_scale = 1.0
    viewer.window.size = size
    until(viewer, lambda: viewer.window.buffer_size == size)
    turn(viewer)
    shown = on_screen(viewer)
    assert shown.shape[:2] == size[::-1]
    expected = picture(viewer)
    free = np.s_[40:-40, size[0] * 3 // 4:]     # neither panel nor menu nor status line
    assert np.abs(shown - expected)[free].mean() < 0.5
    assert np.ptp(expected[free], axis=(0, 1)).max() > 40, "something to see"


def test_nothing_is_drawn_while_minimised(viewer, monkeypatch):
    monkeypatch.setattr(type(viewer.window), "minimised", True)
    frames = viewer.frames
    turn(viewer)
    assert viewer.frames == frames
    monkeypatch.undo()
    turn(viewer, 1)
    assert viewer.frames == frames + 1


def test_an_idle_window_stops_rendering_and_makes_no_new_objects(viewer):
    viewer.state.continuous = False
    viewer.state.settings = SETTINGS.replaced({"temporal_frames": 4})
    turn(viewer, 40)   # until the filter has settled and the picture was looked at once
    context, frames = viewer.window.ctx, viewer.frames
    time.sleep(0.8)
    turn(viewer, 4)

    def names():
        made = context.texture((1, 1), 4), context.buffer(reserve=4)
        numbers = [item.glo for item in made]
        for item in made:
            item.release()
        return numbers

    before = names()
    turn(viewer, 20)
    assert all(after <= number + 1 for after, number in zip(names(), before))
    assert viewer.frames <= frames + 1
    xdotool(viewer, "key", "i")
    assert viewer.frames > frames + 1


def test_lights_reach_the_renderer_and_moving_ones_keep_moving(viewer):
    viewer.state.lights += (Light("point", "mine", intensity=2.0),)
    turn(viewer, 1)
    assert viewer._renderer.lights[-1].name == "mine"
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "p")
    first = viewer._renderer.lights[0]
    turn(viewer)
    assert viewer._renderer.lights[0] != first
    xdotool(viewer, "key", "p")
    first = viewer._renderer.lights[0]
    turn(viewer)
    assert viewer._renderer.lights[0] == first


def test_fewer_levels_take_the_shown_level_along(viewer):
    viewer.actions.toggle_panels()
    viewer.state.inspector = True
    viewer._on_move(*IMAGE_POINT, 0, 0)
    viewer.state.settings = SETTINGS.replaced({"levels": 4})
    turn(viewer, 1)
    viewer.state.buffer, viewer.state.level = "radiance", viewer._renderer.buffers()["radiance"].levels[-1]
    turn(viewer, 1)
    viewer.state.settings = SETTINGS
    viewer._last_reading = 0.0
    turn(viewer, 1)
    assert viewer.state.buffer == "radiance"
    assert viewer.state.level == viewer._renderer.buffers()["radiance"].levels[-1]
    assert viewer.state.inspector and viewer.state.pixel


def test_buffers_step_through_all_levels_and_the_inspector_reads_them(viewer):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "x")
    for name, info in viewer._renderer.buffers().items():
        for level in info.levels:
            viewer.state.buffer, viewer.state.level = name, level
            turn(viewer, 1)
    viewer.state.buffer, viewer.state.level = "view_depth", 0
    time.sleep(0.25)
    turn(viewer, 2)
    depth = viewer._renderer.read("view_depth")[IMAGE_POINT[1] // 2, IMAGE_POINT[0] // 2]
    assert viewer.state.pixel.values["view_depth"][0] == pytest.approx(depth, rel=1e-3)
    xdotool(viewer, "key", "bracketleft")
    assert viewer.state.buffer not in (None, "view_depth")


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_every_panel_draws_at_every_scale(viewer, monkeypatch, scale):
    monkeypatch.setattr(widgets, "section", lambda *_, **__: True)
    monkeypatch.setattr(imgui, "tree_node_ex", lambda text, flags: imgui.tree_node(text))
    state = viewer.state
    state.lights = tuple(Light(kind) for kind in get_args(LightKind))
    state.scene = dataclasses.replace(state.scene, environment=Environment("sky", np.ones((2, 4, 3), np.float32)))
    state.ui_scale = scale
    state.help_open = state.about_open = True
    state.shader_error = "error"
    state.camera.mode = "fly"
    for light in (0, 2, None):
        state.motion = type(state.motion)(light=light, path="swing")
        turn(viewer, 2)
    viewer.actions.browse_scene()
    turn(viewer, 2)
    viewer.actions.toggle_panels()
    turn(viewer, 2)


def test_run_window_closes_after_the_frames_that_were_asked_for(display, scene):
    run_window(scene, SETTINGS, (320, 200), frames=3)


_RUN_AND_TELL_THE_STAGE = """
from ssil_viewer.app import window
from ssil_viewer.scene import load_scene
from ssil_viewer.settings import Settings

class Noted(window.Viewer):
    def release(self):
        print(self._renderer.stage, self.frames)
        super().release()

window.Viewer = Noted
window.run_window(load_scene("builtin:cornell"), Settings(samples=4, levels=2, shadow_resolution=128), (320, 200),
                  frames=2)
"""


def test_opengl_without_compute_is_enough(display):
    """In a process of its own: Mesa keeps the version for all windows that a process opens later."""
    older = {"MESA_GL_VERSION_OVERRIDE": "3.3", "MESA_GLSL_VERSION_OVERRIDE": "330"}
    done = subprocess.run([sys.executable, "-c", _RUN_AND_TELL_THE_STAGE], env={**os.environ, **older},
                          capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "fragment 2\n"), done.stderr
