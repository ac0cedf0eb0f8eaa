"""What two pictures side by side share: the divider between them, and their labels."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from ssil_viewer.app import theme
from ssil_viewer.app.state import AppState

OVERLAY = (imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
           | imgui.WindowFlags_.no_nav | imgui.WindowFlags_.no_focus_on_appearing
           | imgui.WindowFlags_.no_bring_to_front_on_focus)
_GRIP_EM = 0.8      # width of the strip that takes the divider


def divider(state: AppState, top: float, bottom: float) -> None:
    """A line, and a strip around it that takes the mouse."""
    display, width = imgui.get_io().display_size, _GRIP_EM * imgui.get_font_size()
    x = round(state.split * display.x)
    imgui.set_next_window_pos((x - width / 2, top))
    imgui.set_next_window_size((width, bottom - top))
    imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    imgui.push_style_var(imgui.StyleVar_.window_min_size, (1.0, 1.0))
    imgui.begin("##divider", None, OVERLAY | imgui.WindowFlags_.no_background)
    imgui.pop_style_var(3)
    imgui.invisible_button("grip", (width, bottom - top))
    taken = imgui.is_item_active()
    if taken or imgui.is_item_hovered():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    if taken:
        state.split = min(max(imgui.get_io().mouse_pos.x / display.x, 0.02), 0.98)
    commands, middle = imgui.get_window_draw_list(), (top + bottom) / 2
    color = imgui.get_color_u32(theme.ACCENT if taken else ImVec4(1.0, 1.0, 1.0, 0.85))
    commands.add_line(ImVec2(x, top), ImVec2(x, bottom), imgui.get_color_u32(ImVec4(0.0, 0.0, 0.0, 0.6)), 3.0)
    commands.add_line(ImVec2(x, top), ImVec2(x, bottom), color, 1.0)
    commands.add_rect_filled(ImVec2(x - width / 4, middle - width), ImVec2(x + width / 4, middle + width), color, 3.0)
    imgui.end()


def label(name: str, text: str, place: tuple[float, float], pivot: tuple[float, float]) -> float:
    """Text over the image.

    Args:
        place: Window units; it is moved to the left where the text would leave the window.
        pivot: Which point of the label is there, (0, 0) to (1, 1).

    Returns:
        Its upper edge.
    """
    room = imgui.get_io().display_size.x - imgui.calc_text_size(text).x - 3 * imgui.get_style().window_padding.x
    imgui.set_next_window_pos((place[0] if pivot[0] else min(place[0], room), place[1]), imgui.Cond_.always, pivot)
    imgui.set_next_window_bg_alpha(0.75)
    imgui.begin(f"##{name}", None, OVERLAY | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_inputs)
    imgui.text_unformatted(text)
    top = imgui.get_window_pos().y
    imgui.end()
    return top
