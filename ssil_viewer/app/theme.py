"""Fonts, colours and spacing of the panels."""

from __future__ import annotations

from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec4, imgui

FONT_SIZE = 15.0
ACCENT = ImVec4(0.95, 0.66, 0.25, 1.0)
MUTED = ImVec4(0.62, 0.64, 0.67, 1.0)
ERROR = ImVec4(1.0, 0.45, 0.40, 1.0)

_BACKGROUND = (0.095, 0.10, 0.11)
_COLORS = {
    "text": (0.90, 0.91, 0.92, 1.0), "text_disabled": (*MUTED,),
    "window_bg": (*_BACKGROUND, 0.95), "popup_bg": (*_BACKGROUND, 0.98), "menu_bar_bg": (0.075, 0.08, 0.09, 0.98),
    "border": (0.23, 0.24, 0.26, 1.0),
    "frame_bg": (0.17, 0.18, 0.20, 1.0), "frame_bg_hovered": (0.22, 0.23, 0.26, 1.0),
    "frame_bg_active": (0.25, 0.27, 0.30, 1.0),
    "header": (0.16, 0.18, 0.21, 1.0), "header_hovered": (0.22, 0.25, 0.29, 1.0),
    "header_active": (0.25, 0.29, 0.34, 1.0),
    "button": (0.20, 0.22, 0.25, 1.0), "button_hovered": (0.27, 0.30, 0.34, 1.0),
    "button_active": (0.32, 0.36, 0.41, 1.0),
    "slider_grab": (0.36, 0.41, 0.48, 1.0), "slider_grab_active": (0.60, 0.44, 0.20, 1.0), "check_mark": (*ACCENT,),
    "plot_histogram": (0.45, 0.31, 0.13, 1.0),      # how far something is, below text
    "title_bg": (0.11, 0.12, 0.135, 1.0), "title_bg_active": (0.14, 0.155, 0.18, 1.0),
    "separator": (0.23, 0.24, 0.26, 1.0), "table_header_bg": (0.14, 0.15, 0.17, 1.0),
    "table_border_light": (0.19, 0.20, 0.22, 1.0), "table_border_strong": (0.23, 0.24, 0.26, 1.0),
    "table_row_bg_alt": (1.0, 1.0, 1.0, 0.025), "text_selected_bg": (0.95, 0.66, 0.25, 0.35),
    "nav_cursor": (*ACCENT,), "modal_window_dim_bg": (0.0, 0.0, 0.0, 0.45),
    "resize_grip": (0.23, 0.24, 0.26, 1.0), "resize_grip_hovered": (*MUTED,),
    "resize_grip_active": (*ACCENT,),
}


def load_font() -> None:
    """Use the Roboto that comes with imgui-bundle; imgui's built-in font where a package left it out."""
    path = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "Roboto" / "Roboto-Regular.ttf"
    if path.is_file():
        imgui.get_io().fonts.add_font_from_file_ttf(str(path), FONT_SIZE)


def apply(scale: float) -> None:
    """Set the whole style anew for a scale of text and panels."""
    style = imgui.Style()
    imgui.style_colors_dark(style)
    for name, color in _COLORS.items():
        style.set_color_(getattr(imgui.Col_, name), ImVec4(*color))
    style.window_padding = (10, 8)
    style.frame_padding = (7, 4)
    style.item_spacing = (7, 5)
    style.item_inner_spacing = (6, 4)
    style.cell_padding = (6, 3)
    style.indent_spacing = 12
    style.scrollbar_size = 11
    style.grab_min_size = 9
    style.window_rounding = 4
    style.frame_rounding = style.grab_rounding = style.popup_rounding = style.scrollbar_rounding = 3
    style.window_border_size = style.popup_border_size = 1
    style.frame_border_size = 0
    style.window_title_align = (0.0, 0.5)
    style.separator_text_border_size = 1
    style.scale_all_sizes(scale)
    style.font_size_base = FONT_SIZE
    style.font_scale_main = scale
    imgui.get_current_context().style = style
