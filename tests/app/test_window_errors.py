"""What the renderer, the shaders or the system refuse, told by the real window."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from ssil_viewer.app import glfw_window
from ssil_viewer.app.glfw_window import open_window
from ssil_viewer.errors import UserError
from ssil_viewer.gpu import screen_program
from ssil_viewer.gpu.glsl import ShaderError
from tests.app.driving import IMAGE_POINT, NEEDS_X, SETTINGS, SIZE, picture, turn, xdotool

pytestmark = NEEDS_X


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


def test_without_a_display_the_error_says_so(display, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987654")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UserError, match="OpenGL 3.3 core or newer cannot be opened"):
        open_window("test", SIZE)


def test_an_opengl_that_is_too_old_is_an_error_with_the_reason(display, monkeypatch):
    monkeypatch.setattr(glfw_window, "_VERSIONS", ((9, 9),))
    with pytest.raises(UserError, match="3.3 core or newer cannot be opened.*Failed to create"):
        open_window("test", SIZE)
