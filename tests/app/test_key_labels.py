"""Keys by what is written on them, whatever the keyboard."""

from __future__ import annotations

import glfw
import pytest

pytest.importorskip("imgui_bundle")

from imgui_bundle import imgui  # noqa: E402

from ssil_viewer.app.glfw_window import GlfwWindow  # noqa: E402
from ssil_viewer.app.imgui_input import ImguiInput  # noqa: E402

GERMAN = {glfw.KEY_Y: "z", glfw.KEY_Z: "y", glfw.KEY_LEFT_BRACKET: "ü", glfw.KEY_1: "1"}
FRENCH = {glfw.KEY_Q: "a", glfw.KEY_A: "q", glfw.KEY_M: ",", glfw.KEY_SEMICOLON: "m", glfw.KEY_1: "&"}


@pytest.mark.parametrize("names, pressed, meant", [
    (GERMAN, glfw.KEY_Y, glfw.KEY_Z), (GERMAN, glfw.KEY_Z, glfw.KEY_Y), (GERMAN, glfw.KEY_1, glfw.KEY_1),
    (GERMAN, glfw.KEY_LEFT_BRACKET, glfw.KEY_LEFT_BRACKET), (FRENCH, glfw.KEY_Q, glfw.KEY_A),
    (FRENCH, glfw.KEY_M, glfw.KEY_COMMA), (FRENCH, glfw.KEY_SEMICOLON, glfw.KEY_M), (FRENCH, glfw.KEY_1, glfw.KEY_1),
    ({glfw.KEY_KP_DECIMAL: "."}, glfw.KEY_KP_DECIMAL, glfw.KEY_KP_DECIMAL), ({}, glfw.KEY_F5, glfw.KEY_F5),
    ({}, glfw.KEY_UNKNOWN, glfw.KEY_UNKNOWN)])
def test_a_key_is_what_its_cap_says(monkeypatch, names, pressed, meant):
    """As far as the program has such keys; digits of a French keyboard, which write other characters, stay digits."""
    monkeypatch.setattr(glfw, "get_key_name", lambda key, scancode: names.get(key))
    assert GlfwWindow.labelled(pressed) == meant


def test_the_number_pads_enter_ends_what_is_typed():
    class Window:
        keys, size, buffer_size = type("Keys", (), {}), (400, 300), (400, 300)

    context = imgui.create_context()
    try:
        imgui.get_io().backend_flags |= imgui.BackendFlags_.renderer_has_textures
        imgui.get_io().set_ini_filename("")
        given = ImguiInput(Window(), None)

        def frame() -> bool:
            given.begin_frame(0.1)
            imgui.new_frame()
            imgui.set_keyboard_focus_here()
            ended, _ = imgui.input_text("text", "5", imgui.InputTextFlags_.enter_returns_true)
            imgui.render()
            return ended

        assert not any(frame() for _ in range(3))
        given.key(glfw.KEY_KP_ENTER, True, False, False, False)
        assert any(frame() for _ in range(3))
    finally:
        imgui.destroy_context(context)
