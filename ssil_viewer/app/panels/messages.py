"""Messages that go away, the errors of shaders, and the line at the bottom."""

from __future__ import annotations

import math
import time

from imgui_bundle import imgui

from ssil_viewer.app import theme
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.text import showable

_BAR = (imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
        | imgui.WindowFlags_.no_nav | imgui.WindowFlags_.no_focus_on_appearing)
_MESSAGE = _BAR | imgui.WindowFlags_.no_inputs | imgui.WindowFlags_.always_auto_resize
_SPINNER_DOTS = 4


def draw_toasts(state: AppState, bottom: float) -> None:
    """Messages in the lower right corner, the newest at the bottom.

    Args:
        bottom: Where the stack ends, in window units from the top.
    """
    state.drop_old_toasts()
    display, em = imgui.get_io().display_size, imgui.get_font_size()
    y = bottom - 0.6 * em
    for index, toast in reversed(list(enumerate(state.toasts))):
        width = _width_of(toast.text, min(30.0 * em, 0.9 * display.x))
        imgui.set_next_window_pos((display.x - 0.6 * em, y), imgui.Cond_.always, (1.0, 1.0))
        imgui.set_next_window_size((width, 0.0))
        imgui.begin(f"##toast{index}", None, _MESSAGE)
        if toast.kind == "error":
            widgets.complaint(toast.text)
        else:
            imgui.text_wrapped(toast.text)
        y -= imgui.get_window_height() + 0.3 * em
        imgui.end()


def _width_of(text: str, most: float) -> float:
    """What a message needs of the width that it may have; wrapped, no more than its longest line."""
    padding = 2 * imgui.get_style().window_padding.x
    # One more, since a line that just fits is broken
    return math.ceil(min(imgui.calc_text_size(text, False, most - padding).x + padding + 1.0, most))


def draw_work(state: AppState, free: float, top: float) -> None:
    """What is being loaded or made, over the picture, at the top of the window in the middle or right of the panel.

    Args:
        free: Where the panel at the left ends, in window units.
        top: Where the picture begins.
    """
    display, em, padding = imgui.get_io().display_size, imgui.get_font_size(), imgui.get_style().window_padding
    dots = 1 + int(time.monotonic() * 3) % _SPINNER_DOTS
    y = top + 0.6 * em
    loading = f"Loading {showable(state.loading)} " if state.loading else ""
    for text in (loading, f"{state.preparing} " * bool(state.preparing)):
        if text:
            needed = imgui.calc_text_size(text + _SPINNER_DOTS * ".")
            width, height = needed.x + 2 * padding.x, needed.y + 2 * padding.y
            imgui.set_next_window_pos((max((display.x - width) / 2, free + 0.6 * em), y))
            imgui.set_next_window_size((width, height))
            imgui.begin(f"##{text}", None, _BAR | imgui.WindowFlags_.no_inputs)
            imgui.text(text + dots * ".")
            imgui.end()
            y += height + 0.3 * em


def draw_shader_error(state: AppState) -> None:
    """What the compiler said; the old shaders go on meanwhile."""
    if not state.shader_error:
        return
    display, em = imgui.get_io().display_size, imgui.get_font_size()
    imgui.set_next_window_size((min(50 * em, 0.9 * display.x), 0.0), imgui.Cond_.appearing)
    imgui.set_next_window_pos((display.x / 2, display.y / 2), imgui.Cond_.appearing, (0.5, 0.5))
    shown, still_open = imgui.begin("Shader error", True, imgui.WindowFlags_.no_collapse)
    if shown:
        widgets.muted("The old shaders are still in use. Mend the file and press F5.")
        imgui.separator()
        widgets.complaint(state.shader_error)
        if imgui.button("Copy"):
            imgui.set_clipboard_text(state.shader_error)
    imgui.end()
    if not still_open:
        state.shader_error = ""


def status_height() -> float:
    """Height of the line at the bottom."""
    return imgui.get_frame_height() + 2


def draw_status(state: AppState, size: tuple[int, int], software: bool, work: str = "") -> None:
    """What is shown, why there may be no indirect light, and how fast it goes.

    Args:
        work: What goes on although the picture rests, with how far it is, or empty.
    """
    display, height = imgui.get_io().display_size, status_height()
    imgui.set_next_window_pos((0, display.y - height))
    imgui.set_next_window_size((display.x, height))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, (imgui.get_style().window_padding.x, 3.0))
    imgui.begin("##status", None, _BAR)
    imgui.pop_style_var(2)
    seconds = state.frame_time
    rate = f"{1000 * seconds:.1f} ms   {1 / seconds:.{0 if seconds < 0.1 else 1}f} fps" if seconds > 0.0 else "n/a"
    if state.resting:
        rate = "preparing" if state.preparing else "at rest"
    text = f"{'software OpenGL   |   ' if software else ''}{size[0]} x {size[1]}   |   {work or rate}"
    gap, corner, room = imgui.get_font_size(), imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    # What is at the right has its room; of the rest, what matters most comes first
    end = corner.x + room.x - imgui.calc_text_size(text).x - gap
    imgui.push_clip_rect(corner, (max(end, corner.x), corner.y + height), True)
    if state.no_indirect:
        imgui.text_colored(theme.ACCENT, state.no_indirect)
        imgui.same_line(0.0, 2 * gap)
    imgui.text_disabled(_what_is_shown(state))
    imgui.pop_clip_rect()
    imgui.same_line()
    imgui.set_cursor_screen_pos((max(end + gap, corner.x), corner.y))
    imgui.push_style_color(imgui.Col_.text, theme.MUTED)
    imgui.text(text)
    imgui.pop_style_color()
    imgui.end()


def _what_is_shown(state: AppState) -> str:
    shown = f"buffer {state.buffer}, level {state.level}" if state.buffer else f"{state.settings.show} light"
    if not state.buffer and state.settings.show == "both":
        shown = "direct + indirect light"
    exposed = f"   |   exposure {state.settings.exposure:+.1f} EV" if state.settings.exposure else ""
    return f"{state.scene_title}   |   {shown}   |   {state.camera.mode}{exposed}"
