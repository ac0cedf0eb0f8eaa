"""Fixtures of the real window under a virtual screen."""

from __future__ import annotations

import ctypes
import os
import subprocess

import pytest
from imgui_bundle import imgui

from ssil_viewer.app.glfw_window import open_window
from ssil_viewer.app.panels import settings as settings_panel
from ssil_viewer.app.window import Viewer
from ssil_viewer.scene import default_camera, load_scene
from tests.app.driving import SETTINGS, SIZE, turn


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
