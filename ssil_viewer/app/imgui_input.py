"""Feeds the events of a moderngl-window window to imgui."""

from __future__ import annotations

from typing import Any, Callable

import glfw
from imgui_bundle import imgui

_NAMES = {
    "ESCAPE": "escape", "SPACE": "space", "ENTER": "enter", "TAB": "tab", "BACKSPACE": "backspace",
    "DELETE": "delete", "INSERT": "insert", "HOME": "home", "END": "end", "PAGE_UP": "page_up",
    "PAGE_DOWN": "page_down", "LEFT": "left_arrow", "RIGHT": "right_arrow", "UP": "up_arrow",
    "DOWN": "down_arrow", "LEFT_SHIFT": "left_shift", "RIGHT_SHIFT": "right_shift", "LEFT_CTRL": "left_ctrl",
    "MINUS": "minus", "PERIOD": "period", "COMMA": "comma", "SLASH": "slash", "EQUAL": "equal",
    "SEMICOLON": "semicolon", "LEFT_BRACKET": "left_bracket", "RIGHT_BRACKET": "right_bracket",
    "BACKSLASH": "backslash",
    **{chr(code): chr(code).lower() for code in range(ord("A"), ord("Z") + 1)},
    **{f"NUMBER_{digit}": f"_{digit}" for digit in range(10)},
    **{f"F{number}": f"f{number}" for number in range(1, 13)},
}
_BUTTONS = {1: 0, 2: 1, 3: 2}   # moderngl-window: left, right, middle from 1; imgui the same from 0


class ImguiInput:
    """Translates keys, buttons and sizes. Positions are in window units, as imgui wants them.

    Args:
        window: A moderngl-window window.
        handle: Its glfw handle, for the clipboard.
        keys_wait: Whether a text field is about to take the keyboard: imgui would lose what is typed until then.
    """

    def __init__(self, window: Any, handle: Any, keys_wait: Callable[[], bool] = lambda: False) -> None:
        self._io = imgui.get_io()
        self._keys_wait = keys_wait
        self._waiting: list[Callable[[], None]] = []    # keys and text that imgui gets later
        self._released: list[int] = []      # buttons of whose release imgui hears later
        self._window = window
        self._keys = {getattr(window.keys, name): getattr(imgui.Key, imgui_name)
                      for name, imgui_name in _NAMES.items() if hasattr(window.keys, name)}
        self._keys |= {glfw.KEY_KP_ENTER: imgui.Key.keypad_enter}   # moderngl-window has no name for it
        # Ctrl and Cmd both come as Ctrl (window.py), on every system; imgui would swap them on macOS
        self._io.config_mac_osx_behaviors = False
        platform = imgui.get_platform_io()
        platform.platform_get_clipboard_text_fn = lambda _: (glfw.get_clipboard_string(handle) or b"").decode()
        platform.platform_set_clipboard_text_fn = lambda _, text: glfw.set_clipboard_string(handle, text)

    def begin_frame(self, seconds: float) -> None:
        """Sizes and time of the frame that starts."""
        if not imgui.get_current_context().input_events_queue:
            self._release()
        if not self._keys_wait():
            for send in self._waiting:
                send()
            self._waiting.clear()
        width, height = self._window.size
        pixels = self._window.buffer_size
        self._io.display_size = (width, height)
        self._io.display_framebuffer_scale = (pixels[0] / max(width, 1), pixels[1] / max(height, 1))
        self._io.delta_time = max(seconds, 1e-4)

    def key(self, key: Any, down: bool, ctrl: bool, shift: bool, alt: bool) -> None:
        """A key went down or up; the modifiers are those held afterwards."""
        def send() -> None:
            self._io.add_key_event(imgui.Key.mod_ctrl, ctrl)
            self._io.add_key_event(imgui.Key.mod_shift, shift)
            self._io.add_key_event(imgui.Key.mod_alt, alt)
            if key in self._keys:
                self._io.add_key_event(self._keys[key], down)

        self._send_or_keep(send)

    def character(self, text: str) -> None:
        """Text was typed."""
        self._send_or_keep(lambda: self._io.add_input_character(ord(text)))

    def _send_or_keep(self, send: Callable[[], None]) -> None:
        if self._waiting or self._keys_wait():
            self._waiting.append(send)
        else:
            send()

    def move(self, x: float, y: float) -> None:
        """The cursor is at a place of the window."""
        self._io.add_mouse_pos_event(x, y)

    def button(self, button: int, down: bool) -> None:
        """A mouse button of moderngl-window's numbering went down or up."""
        if button not in _BUTTONS:
            return
        if down:
            self._release()
            self._io.add_mouse_button_event(_BUTTONS[button], True)
        else:
            # imgui would take a move and the release after it in one frame, and a slider would not follow the move
            self._released.append(_BUTTONS[button])

    def _release(self) -> None:
        for button in self._released:
            self._io.add_mouse_button_event(button, False)
        self._released.clear()

    def is_over(self, x: float, y: float) -> bool:
        """Whether the interface, as it was last drawn, takes the mouse at a place, in window units.

        `want_capture_mouse` tells of where the mouse was then; after a slow frame it is elsewhere.
        """
        if imgui.is_popup_open("", imgui.PopupFlags_.any_popup):
            return True
        windows = imgui.get_current_context().windows
        return any(w.outer_rect_clipped.contains((x, y)) for w in windows
                   if w.active and not w.hidden and not w.flags & imgui.WindowFlags_.no_mouse_inputs)

    def wheel(self, x: float, y: float) -> None:
        """The wheel turned."""
        self._io.add_mouse_wheel_event(x, y)
