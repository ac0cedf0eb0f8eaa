"""The real window while shaders are compiled and rays are prepared: it goes on, says so, and then switches."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer import compile_ahead, saved_view
from ssil_viewer.app.glfw_window import open_window
from ssil_viewer.app.window import Viewer
from ssil_viewer.errors import UserError
from ssil_viewer.gpu import scene_rays
from ssil_viewer.scene import default_camera
from tests.app.driving import NEEDS_X, SETTINGS, SIZE, turn, until

pytestmark = NEEDS_X
RAYS = replace(SETTINGS, unseen_samples=1)


@pytest.fixture
def held(monkeypatch):
    """Tables for rays are made no sooner than this is set, and the thread that compiles ends at once."""
    event, original = threading.Event(), scene_rays.spread_surfels

    def wait(*arguments):
        assert event.wait(30)
        return original(*arguments)

    monkeypatch.setattr(scene_rays, "spread_surfels", wait)
    monkeypatch.setattr(compile_ahead.Ahead, "compile_on", lambda *_: None)
    yield event
    event.set()


def above_the_picture(viewer):
    """Pixels of the window where a message about what is prepared stands."""
    return viewer._window_pixels()[30:60, 330:].astype(int)


def test_the_old_settings_go_on_until_the_new_ones_are_ready(viewer, held, tmp_path):
    plain = above_the_picture(viewer)
    viewer.state.settings = RAYS
    for _ in range(3):
        viewer.step()
    assert viewer.state.preparing == "Preparing rays and shaders for these settings"
    assert np.abs(above_the_picture(viewer) - plain).max() > 60, "a message is on the screen"
    frames = viewer.frames
    for _ in range(5):
        viewer.state.camera.rotate(0.02, 0.0)
        viewer.step()
    assert viewer.frames == frames + 5 and viewer._renderer.settings == SETTINGS
    viewer.actions.save_image()
    path, = tmp_path.glob("*.png")
    assert saved_view.load_picture(path).settings == SETTINGS, "the picture has those, still"
    held.set()
    until(viewer, lambda: viewer._renderer.settings == RAYS)
    turn(viewer)
    assert viewer.state.settings == RAYS and viewer.state.preparing == ""
    assert "unseen_radiance" in viewer._renderer.runner.plan.running_targets
    assert viewer.frames > frames + 5


def test_the_message_stays_while_the_frame_compiles_and_goes_before_the_next(viewer, monkeypatch):
    """So it is where nothing is compiled beside the window: with all drivers but llvmpipe."""
    monkeypatch.setattr(compile_ahead, "helps", lambda capabilities: False)
    viewer.state.settings = replace(SETTINGS, mip_filter="average")
    said, log, render = [], [], viewer._renderer.render

    def noted(camera):
        said.append(viewer.state.preparing)
        render(camera)

    monkeypatch.setattr(viewer._renderer, "render", noted)
    for _ in range(8):
        frames, settings = viewer.frames, viewer._renderer.settings
        message = bool(viewer.state.preparing)      # what this turn draws over the picture
        viewer.step()
        log.append((message, viewer.frames > frames, settings != viewer._renderer.settings))
    # Software OpenGL draws nothing before the switch, since nothing changes
    assert log == [(False, False, False), *[(True, False, False)] * 2, (True, True, True),
                   *[(False, False, False)] * 2, *[(False, True, False)] * 2]
    assert said == ["Compiling shaders for these settings", "", ""]


def test_what_compiles_nothing_comes_at_once_and_says_nothing(viewer):
    for change in ({"samples": 6}, {"radius": 40.0}, {"exposure": 1.0}, {"show": "direct"}, {"thickness": 0.2},
                   {"shadow_resolution": 256}, {"temporal_frames": 9}):
        viewer.state.settings = viewer.state.settings.replaced(change)
        frames = viewer.frames
        viewer.step()
        assert viewer._renderer.settings == viewer.state.settings and viewer.frames == frames + 1, change
        assert viewer.state.preparing == "", change


def test_what_cannot_be_prepared_leaves_the_old_settings_and_says_so(viewer, monkeypatch):
    def refuse(*arguments):
        raise UserError("too many triangles", "cornell", "take fewer")

    monkeypatch.setattr(scene_rays, "check_triangle_count", refuse)
    viewer.state.settings = RAYS
    turn(viewer)
    assert viewer.state.settings == viewer._renderer.settings == SETTINGS and viewer.state.preparing == ""
    assert any("too many triangles" in toast.text and toast.kind == "error" for toast in viewer.state.toasts)
    frames = viewer.frames
    turn(viewer)
    assert viewer.frames > frames


def test_taking_settings_back_ends_the_message(viewer, held):
    viewer.state.settings = RAYS
    viewer.step()
    viewer.step()
    assert viewer.state.preparing
    viewer.state.settings = SETTINGS
    viewer.step()
    assert viewer.state.preparing == "" and viewer._renderer.settings == SETTINGS


def test_before_the_first_frame_the_window_says_that_it_compiles(display, scene):
    window = open_window("test", SIZE, vsync=False)
    viewer = Viewer(window, scene, SETTINGS, default_camera(scene), vsync=False)
    viewer.state.timings_visible = False
    try:
        for _ in range(3):
            viewer.step()
        assert viewer.frames == 0 and viewer.state.preparing == "Compiling shaders"
        pixels = viewer._window_pixels().astype(int)
        assert pixels[30:60, 330:].max() > 100, "the message"
        assert pixels[200:300, 340:].max() == 0, "and no picture"
        viewer.step()
        assert viewer.frames == 1
        viewer.step()
        assert viewer.state.preparing == "" and viewer._window_pixels()[200:300, 340:].max() > 60
    finally:
        viewer.release()
        window.destroy()


def test_closing_the_window_waits_for_what_compiles(display, scene, monkeypatch):
    started = threading.Event()

    def compile(ahead, context):
        started.set()
        assert ahead._stop.wait(30)

    monkeypatch.setattr(compile_ahead.Ahead, "compile_on", compile)
    monkeypatch.setattr(compile_ahead, "helps", lambda capabilities: True)
    window = open_window("test", SIZE, vsync=False)
    viewer = Viewer(window, scene, SETTINGS, default_camera(scene), vsync=False)
    try:
        until(viewer, lambda: viewer.frames == 1)
        viewer.state.settings = replace(SETTINGS, mip_filter="average")
        until(viewer, started.is_set)
    finally:
        viewer.release()
        window.destroy()
    assert "compile-ahead" not in [thread.name for thread in threading.enumerate()]
