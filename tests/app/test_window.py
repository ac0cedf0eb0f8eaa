"""The real window under Xvfb, driven by real X events through xdotool."""

from __future__ import annotations

import ctypes
import dataclasses
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

import ssil_viewer
from ssil_viewer import cli, output
from ssil_viewer.app import glfw_window, saved_view, theme
from ssil_viewer.app import window as app_window
from ssil_viewer.app.glfw_window import open_window
from ssil_viewer.app.panels import settings as settings_panel
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.window import Viewer, run_window
from ssil_viewer.errors import UserError
from ssil_viewer.gpu import screen_program
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.metering import metered_exposure
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Light, LightKind
from ssil_viewer.settings import Settings

pytestmark = [pytest.mark.window, pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")),
    reason="Xvfb and xdotool are needed to drive the real window: apt install xvfb xdotool")]

SIZE = 640, 360
SETTINGS = Settings(samples=4, levels=2, shadow_resolution=128)
IMAGE_POINT = 480, 250   # window units; right of the panel


@pytest.fixture(scope="module")
def egl_aside():
    """Lay aside the EGL context that other tests may have left current: GLX refuses to work beside it."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        yield
        return
    for name in ("eglGetCurrentDisplay", "eglGetCurrentContext"):
        getattr(egl, name).restype = ctypes.c_void_p
    egl.eglMakeCurrent.argtypes = [ctypes.c_void_p] * 4
    display, context = egl.eglGetCurrentDisplay(), egl.eglGetCurrentContext()
    if context:
        egl.eglMakeCurrent(display, None, None, None)
    yield
    if context:
        egl.eglMakeCurrent(display, None, None, context)


@pytest.fixture(scope="module")
def display(egl_aside):
    """A virtual screen of its own for this module."""
    reader, writer = os.pipe()
    # Without -noreset the server starts anew when the last window closes, and may refuse the next one meanwhile.
    server = subprocess.Popen(["Xvfb", "-displayfd", str(writer), "-screen", "0", "1024x768x24", "-nolisten", "tcp",
                               "-noreset"], pass_fds=[writer], stderr=subprocess.DEVNULL)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        number = pipe.readline().strip()
    before = os.environ.get("DISPLAY")
    os.environ["DISPLAY"] = f":{number}"
    yield os.environ["DISPLAY"]
    if before is None:
        del os.environ["DISPLAY"]
    else:
        os.environ["DISPLAY"] = before
    server.terminate()
    server.wait(10)


@pytest.fixture(scope="module")
def scene():
    return load_scene("builtin:cornell")


@pytest.fixture
def viewer(display, scene, tmp_path, monkeypatch):
    """An open window that has drawn its first frames; the working directory is empty."""
    monkeypatch.chdir(tmp_path)
    window = open_window("test", SIZE, vsync=False)
    viewer = Viewer(window, scene, SETTINGS, default_camera(scene), vsync=False)
    viewer.state.continuous = True
    viewer.state.timings_visible = False   # leaves room for the mouse
    viewer.state.render_scale = 0.5        # software OpenGL on few cores
    viewer.window = window
    turn(viewer, 3)
    yield viewer
    error = window.ctx.error
    viewer.release()
    window.destroy()
    assert error == "GL_NO_ERROR"


def turn(viewer, count=4):
    """Some turns; what takes long is prepared meanwhile, and turns on which a frame waits for that do not count."""
    for _ in range(count):
        viewer.step()
        until(viewer, lambda: not viewer.state.preparing, 60.0)


def until(viewer, condition, seconds=15.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never happened"
        viewer.step()


def xdotool(viewer, *words):
    """Send one event, then let the window take it."""
    subprocess.run(["xdotool", *map(str, words)], check=True)
    time.sleep(0.03)   # the server passes it on by itself
    turn(viewer, 3)


def click(viewer, place, button=1):
    xdotool(viewer, "mousemove", *place)
    xdotool(viewer, "mousedown", button)
    xdotool(viewer, "mouseup", button)


def drag(viewer, start, end, button=1):
    xdotool(viewer, "mousemove", *start)
    xdotool(viewer, "mousedown", button)
    xdotool(viewer, "mousemove", *[round((a + b) / 2) for a, b in zip(start, end)])
    xdotool(viewer, "mousemove", *end)
    xdotool(viewer, "mouseup", button)


@pytest.fixture
def places(monkeypatch):
    """Where the widgets of the settings are: name -> (left, top, right, bottom) in window units."""
    found = {}
    original = settings_panel._widget

    def noted(info, value):
        result = original(info, value)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        found[info.name] = (low.x, low.y, high.x, high.y)
        return result

    monkeypatch.setattr(settings_panel, "_widget", noted)
    return found


def picture(viewer):
    renderer = viewer._renderer
    return np.frombuffer(renderer.display.read(), np.uint8).reshape(*renderer.size[::-1], 4)[::-1, :, :3].astype(int)


def test_a_slider_changes_the_settings_and_a_right_click_resets_them(places, viewer):
    turn(viewer)
    left, top, right, bottom = places["samples"]
    y = (top + bottom) / 2
    drag(viewer, (left + 5, y), (right - 2, y))
    assert viewer.state.settings.samples > 500
    assert viewer._renderer.settings == viewer.state.settings
    click(viewer, ((left + right) / 2, y), button=3)
    assert viewer.state.settings.samples == Settings().samples


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


def test_pictures_are_saved_with_and_without_panels(viewer, tmp_path):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "F12")
    path, = tmp_path.glob("*.png")
    image = np.asarray(Image.open(path))
    assert image.shape == (SIZE[1] // 2, SIZE[0] // 2, 3)
    assert np.abs(image.astype(int) - picture(viewer)).mean() < 2.0   # the temporal filter has gone on since
    stored = saved_view.load_picture(path)
    assert stored.settings == viewer.state.settings and stored.scene == "builtin:cornell"
    assert stored.camera.eye == pytest.approx(viewer.state.camera.eye)
    xdotool(viewer, "key", "shift+F12")
    other, = set(tmp_path.glob("*.png")) - {path}
    window = np.asarray(Image.open(other)).astype(int)
    assert window.shape == (SIZE[1], SIZE[0], 3)
    panel = [round(255 * channel) for channel in theme._COLORS["menu_bar_bg"][:3]]
    assert np.abs(window[4, 500] - panel).max() < 16
    seen, saved = window[IMAGE_POINT[1], IMAGE_POINT[0]], image[IMAGE_POINT[1] // 2, IMAGE_POINT[0] // 2]
    assert np.abs(seen - saved).max() < 16


def test_a_dropped_picture_brings_settings_camera_and_lights_back(viewer, tmp_path):
    lights = viewer.state.lights = (dataclasses.replace(viewer.state.lights[0], intensity=3.0, name="dim"),)
    turn(viewer)
    viewer.actions.save_image()
    saved = saved_view.load_picture(next(tmp_path.glob("*.png")))
    viewer.actions.show("indirect")
    viewer.state.camera.rotate(0.3, 0.1)
    viewer.state.lights = ()
    viewer.window.dropped(list(tmp_path.glob("*.png")))
    turn(viewer)
    assert viewer._renderer.settings == saved.settings and viewer._renderer.lights == saved.lights == lights
    assert viewer.state.camera.eye == pytest.approx(saved.camera.eye)


def test_lights_are_saved_as_they_are_and_dropped_again(viewer, tmp_path):
    viewer.state.lights = (Light("sphere", "ball", intensity=5.0, position=(0.1, 1.0, 0.2), radius=0.25),)
    viewer.actions.save_lights()
    path, = tmp_path.glob("ssil-lights-*.toml")
    saved, viewer.state.lights = viewer.state.lights, ()
    viewer.window.dropped([path])
    turn(viewer)
    assert viewer._renderer.lights == saved


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


def test_a_scene_is_loaded_beside_the_window_and_a_broken_one_leaves_the_old(viewer, scene, tmp_path):
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF but not really")
    viewer.window.dropped([broken])
    assert viewer.state.loading
    until(viewer, lambda: not viewer.state.loading)
    assert any(toast.kind == "error" and "broken.glb" in toast.text for toast in viewer.state.toasts)
    assert viewer.state.scene is scene and viewer._renderer.scene is scene
    viewer.actions.open_scene("builtin:arch")
    until(viewer, lambda: not viewer.state.loading)
    turn(viewer)
    assert viewer.state.scene.name == viewer._renderer.scene.name == "builtin:arch"


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


def test_settings_that_the_renderer_refuses_are_taken_back(viewer, monkeypatch):
    def refuse(settings, ray_tables=None):
        raise UserError("too much for this GPU", "--levels")

    monkeypatch.setattr(viewer._renderer, "set_settings", refuse)
    viewer.state.settings = SETTINGS.replaced({"levels": 3})
    turn(viewer)
    assert viewer.state.settings == SETTINGS
    assert any("too much" in toast.text for toast in viewer.state.toasts)


def test_a_refused_size_is_not_asked_for_again(viewer, monkeypatch):
    asked = []

    def refuse(size):
        asked.append(size)
        raise UserError("too large", "--size")

    monkeypatch.setattr(viewer._renderer, "resize", refuse)
    viewer.state.render_scale = 0.6
    viewer.state.settings = SETTINGS.replaced({"exposure": 0.5})
    turn(viewer)
    assert len(asked) == 2   # once more under other settings
    assert viewer.state.settings.exposure == 0.5 and any("too large" in toast.text for toast in viewer.state.toasts)


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


def test_the_inspector_is_put_away_when_it_cannot_read(viewer, monkeypatch):
    def refuse(name, level=0):
        raise UserError("there is no such buffer")

    viewer.state.inspector, viewer._last_reading = True, 0.0
    viewer._on_move(*IMAGE_POINT, 0, 0)
    monkeypatch.setattr(viewer._renderer, "read", refuse)
    turn(viewer, 1)
    assert not viewer.state.inspector and any("no such buffer" in toast.text for toast in viewer.state.toasts)


def test_settings_whose_shaders_do_not_compile_are_taken_back(viewer, monkeypatch):
    before, broken = picture(viewer), []
    init = screen_program.ScreenProgram.__init__

    def compile(self, context, variant, *arguments):
        if variant.shader == "passes/gather.glsl":
            broken.append(threading.current_thread())
            raise ShaderError("passes/gather.glsl:12: wrong")
        init(self, context, variant, *arguments)

    monkeypatch.setattr(screen_program.ScreenProgram, "__init__", compile)
    viewer.state.settings = SETTINGS.replaced({"form_factor": "point", "levels": 3})
    turn(viewer)
    assert broken.count(threading.main_thread()) == 1 and "gather.glsl:12" in viewer.state.shader_error
    assert viewer.state.settings == viewer._renderer.settings == SETTINGS
    assert np.abs(picture(viewer) - before).mean() < 4.0


def test_a_view_whose_shaders_do_not_compile_leaves_the_picture(viewer, monkeypatch):
    before, tries = picture(viewer), []

    def fail(camera):
        tries.append(camera)
        raise ShaderError("passes/shadow.glsl:3: wrong")

    monkeypatch.setattr(viewer._renderer, "render", fail)
    turn(viewer)
    assert len(tries) == 1 and "shadow.glsl:3" in viewer.state.shader_error
    assert np.array_equal(picture(viewer), before)
    monkeypatch.undo()
    frames = viewer.frames
    viewer.actions.reload_shaders()
    turn(viewer, 1)
    assert viewer.frames == frames + 1 and viewer.state.shader_error == ""


def test_a_shader_error_is_shown_and_the_picture_stays(viewer, monkeypatch):
    monkeypatch.setattr(viewer._renderer, "reload_shaders", lambda: "passes/gather.glsl:12: 100 % wrong")
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "F5")
    assert "gather.glsl:12" in viewer.state.shader_error
    assert picture(viewer).mean() > 5.0
    monkeypatch.undo()
    xdotool(viewer, "key", "F5")
    assert viewer.state.shader_error == ""


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


def test_an_environment_and_lights_are_opened_like_scenes(viewer, tmp_path):
    """Its own sun goes when a map comes, a broken map changes nothing, and a scene opened later keeps the map."""
    sky = tmp_path / "sky.exr"
    output.write_exr(sky, {"": np.full((8, 16, 3), 0.5, np.float32)})
    (tmp_path / "broken.hdr").write_bytes(b"nothing")
    (tmp_path / "lamp.toml").write_text("keep = true\n[[light]]\nkind = 'disc'\nname = 'lamp'")
    viewer.actions.open_path(sky)
    turn(viewer, 2)
    environment = viewer._renderer.environment
    assert environment.name == str(sky) and "sky" in viewer._renderer.buffers()
    viewer.actions.open_path(tmp_path / "broken.hdr")
    turn(viewer, 2)
    assert viewer._renderer.environment is environment
    assert "broken.hdr" in viewer.state.toasts[-1].text
    viewer.actions.open_path(tmp_path / "lamp.toml")
    turn(viewer, 2)
    assert viewer._renderer.lights[-1].name == "lamp" and len(viewer._renderer.lights) == 2
    viewer.actions.open_scene("builtin:arch")
    until(viewer, lambda: viewer.state.scene.name == "builtin:arch")
    turn(viewer, 2)
    assert viewer._renderer.environment is environment
    viewer.actions.remove_environment()
    turn(viewer, 2)
    assert viewer._renderer.environment is None and "sky" not in viewer._renderer.buffers()


def test_a_clear_sky_goes_with_the_sun(viewer, tmp_path):
    """The default sun stays beside it, also in a scene opened later, and comes back from under clouds."""
    path = tmp_path / "box.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for name, suns in (("sky", 1), ("overcast", 0), ("sky", 1)):
        viewer.actions.open_environment(Path(f"builtin:{name}"))
        if viewer.state.scene.name != str(path):
            viewer.actions.open_scene(str(path))
            until(viewer, lambda: viewer.state.scene.name == str(path))
        turn(viewer, 2)
        assert viewer._renderer.environment.name == f"builtin:{name}"
        assert [light.name for light in viewer._renderer.lights] == ["default sun"] * suns


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


@pytest.fixture
def dim(scene):
    """The Cornell box with a lamp that is nine stops weaker."""
    lights = tuple(dataclasses.replace(light, intensity=light.intensity / 500) for light in scene.lights)
    return dataclasses.replace(scene, name="dim", lights=lights)


def open_in(viewer, scene):
    """Open a scene in the window as if it had been loaded from a file."""
    viewer.actions._loader._load = lambda source: scene
    viewer.actions.open_scene(scene.name)
    until(viewer, lambda: not viewer.state.loading)
    turn(viewer)


def test_a_dark_scene_opens_with_an_exposure_of_its_own(viewer, scene, dim):
    state = viewer.state
    viewer.actions.exposure.start()
    turn(viewer)
    assert state.settings.exposure == 0.0, "the box itself needs none"
    open_in(viewer, dim)
    chosen = state.settings.exposure
    assert chosen > 5.0 and viewer._renderer.settings.exposure == chosen
    assert picture(viewer).mean() > 40
    open_in(viewer, scene)
    assert state.settings.exposure == 0.0, "the next scene is looked at anew"
    # A lamp that is added is, too: by a file or as an environment
    open_in(viewer, dim)
    viewer.actions._set_environment(Environment("white", np.ones((8, 16, 3), np.float32)))
    turn(viewer)
    assert state.settings.exposure == 0.0


def test_an_exposure_that_the_user_chose_stays(viewer, scene, dim):
    state = viewer.state
    open_in(viewer, dim)
    assert state.settings.exposure == 0.0, "as given on the command line"
    viewer.actions.exposure.start()
    turn(viewer)
    chosen = state.settings.exposure
    assert chosen > 5.0
    viewer.actions.set_settings(Settings())     # a right click, or Reset all
    open_in(viewer, dim)
    assert state.settings.exposure == 0.0
    # What is chosen while the first frame is still prepared is not thrown away
    viewer.actions.exposure.start()
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=1.0))
    turn(viewer)
    assert state.settings.exposure == 1.0


def test_a_reload_keeps_the_exposure_and_a_saved_picture_brings_its_own(viewer, dim, tmp_path):
    state = viewer.state
    viewer.actions.exposure.start()
    open_in(viewer, dim)
    chosen = state.settings.exposure
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=chosen - 1.0))
    viewer.actions.save_image()
    viewer.actions.reload_scene()
    until(viewer, lambda: not state.loading)
    turn(viewer)
    assert state.settings.exposure == chosen - 1.0
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=3.0))
    state.scene = dataclasses.replace(state.scene, name="another")
    viewer.window.dropped(list(tmp_path.glob("*.png")))
    until(viewer, lambda: not state.loading)
    turn(viewer)
    assert state.settings.exposure == chosen - 1.0


@pytest.mark.parametrize("show", ["both", "direct", "indirect", "glossy"])
def test_the_exposure_is_that_of_the_light_that_is_shown(viewer, show):
    """As metered from what a renderer that keeps everything has: M reads other buffers."""
    settings = dataclasses.replace(SETTINGS, samples=32)
    glossy = load_scene("builtin:glossy")
    images = ssil_viewer.render(glossy, size=viewer._renderer.size, settings=settings, frames=8)
    parts = {"both": images["final"], "direct": images["direct"], "glossy": images["glossy"],
             "indirect": images["final"] - images["direct"]}
    viewer.state.settings = settings
    open_in(viewer, glossy)
    viewer.actions.show(show)
    turn(viewer, 8)
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "m")
    expected = metered_exposure(parts[show], images["view_depth"] > 0)
    assert viewer.state.settings.exposure == pytest.approx(expected, abs=0.4)


def test_without_light_the_exposure_stays(viewer):
    viewer.state.lights = ()
    viewer.actions.set_settings(dataclasses.replace(viewer.state.settings, exposure=2.0, temporal=False))
    turn(viewer)
    viewer.actions.meter_exposure()
    turn(viewer)
    assert viewer.state.settings.exposure == 2.0
    assert any("Nothing shines" in toast.text for toast in viewer.state.toasts)


@pytest.mark.parametrize(("flags", "looked_at"), [
    ([], True), (["--exposure", "0"], False), (["--exposure", "2"], False), (["--samples", "9"], True)])
def test_the_window_may_choose_where_the_command_line_does_not(monkeypatch, flags, looked_at):
    given = {}
    monkeypatch.setattr(app_window, "run_window", lambda **options: given.update(options))
    monkeypatch.setenv("DISPLAY", ":0")
    assert cli.main(["view", "builtin:cornell", *flags]) == 0
    assert given["choose_exposure"] == looked_at


def test_run_window_closes_after_the_frames_that_were_asked_for(display, scene):
    run_window(scene, SETTINGS, (320, 200), frames=3)


def test_without_a_display_the_error_says_so(display, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987654")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UserError, match="OpenGL 3.3 core or newer cannot be opened"):
        open_window("test", SIZE)


def test_an_opengl_that_is_too_old_is_an_error_with_the_reason(display, monkeypatch):
    monkeypatch.setattr(glfw_window, "_VERSIONS", ((9, 9),))
    with pytest.raises(UserError, match="3.3 core or newer cannot be opened.*Failed to create"):
        open_window("test", SIZE)


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
