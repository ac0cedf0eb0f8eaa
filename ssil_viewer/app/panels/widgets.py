"""Small parts that all panels share."""

from __future__ import annotations

from typing import Callable

from imgui_bundle import ImVec4, imgui

from ssil_viewer.app import theme
from ssil_viewer.text import showable

_LABEL_SHARE = 0.42
_TOOLTIP_EM = 26.0


def title_of(name: str) -> str:
    """A field name as people read it: "start_level" is "Start level"."""
    return name.replace("_", " ").capitalize()


def label(text: str, tooltip: str = "", marked: bool = False) -> bool:
    """The left part of a row; the next widget fills the rest of it.

    Args:
        marked: Drawn in the accent colour: the value is not the default.

    Returns:
        Whether the label was clicked with the right button.
    """
    width = max(_LABEL_SHARE * imgui.get_content_region_avail().x, 1.0)
    left = imgui.get_cursor_pos_x()
    # A button, so that the whole row is sensitive and not just the letters.
    imgui.invisible_button(f"##label of {text}", (width, imgui.get_frame_height()))
    corner, far = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    clicked = imgui.is_item_clicked(imgui.MouseButton_.right)
    hint(tooltip)
    commands = imgui.get_window_draw_list()
    color = theme.ACCENT if marked else imgui.get_style().color_(imgui.Col_.text)
    imgui.push_clip_rect(corner, far, True)
    commands.add_text((corner.x, corner.y + imgui.get_style().frame_padding.y), imgui.get_color_u32(color), text)
    imgui.pop_clip_rect()
    imgui.same_line(left + width)
    imgui.set_next_item_width(-1)
    return clicked


def hint(text: str) -> None:
    """A tooltip of the last item, after a short rest of the mouse; not over the rows below while the item is in use."""
    rests = imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.delay_short)
    if text and rests and not imgui.is_item_active():
        imgui.push_style_var(imgui.StyleVar_.alpha, 1.0)   # of a faint item, too
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(imgui.get_font_size() * _TOOLTIP_EM)
        imgui.text(showable(text))
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
        imgui.pop_style_var()


def close_on_escape() -> None:
    """Within a popup: the key closes it."""
    if imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()


def muted(text: str) -> None:
    """A remark, wrapped."""
    _wrapped(text, theme.MUTED)


def complaint(text: str) -> None:
    """An error, wrapped."""
    _wrapped(text, theme.ERROR)


def section(text: str, open_at_first: bool = False) -> bool:
    """A collapsible part of the panel."""
    flags = imgui.TreeNodeFlags_.default_open if open_at_first else imgui.TreeNodeFlags_.none
    return imgui.collapsing_header(text, flags)


def choice(name: str, current: str, choices: tuple[str, ...] | list[str]) -> str:
    """A combo box without a label; returns what is chosen now."""
    result = current
    if imgui.begin_combo(f"##{name}", current):
        close_on_escape()
        for item in choices:
            if imgui.selectable(item, item == current)[0]:
                result = item
            if item == current:
                imgui.set_item_default_focus()
        imgui.end_combo()
    return result


def right_aligned(text: str) -> None:
    """Text at the right end of the column."""
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    if room > 0.0:
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + room)
    imgui.text(text)


def vector(name: str, value: tuple[float, ...], speed: float) -> tuple[bool, tuple[float, ...]]:
    """Three numbers to drag or type."""
    changed, new = imgui.drag_float3(f"##{name}", list(value), speed, 0.0, 0.0, "%.3f")
    return changed, tuple(new)


def path_field(name: str, text: str, browse: Callable[[], None]) -> tuple[str, str]:
    """A field for a path and a button to browse. Returns what stands in the field, and the path when Enter was pressed,
    else ""."""
    imgui.set_next_item_width(-imgui.calc_text_size("Browse").x - 4 * imgui.get_style().frame_padding.x)
    entered, text = imgui.input_text_with_hint(name, "path", text, imgui.InputTextFlags_.enter_returns_true)
    imgui.same_line()
    if imgui.button(f"Browse{name}"):
        browse()
    return text, text.strip().strip('"') if entered else ""


def _wrapped(text: str, color: ImVec4) -> None:
    imgui.push_style_color(imgui.Col_.text, color)
    imgui.text_wrapped(showable(text))
    imgui.pop_style_color()
