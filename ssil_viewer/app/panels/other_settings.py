"""Settings A and B: keeping, swapping, what differs, and the labels over the image."""

from __future__ import annotations

from typing import Any

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.other_settings import OtherSettings
from ssil_viewer.app.panels import split, widgets
from ssil_viewer.app.state import AppState

_MOST_NAMED = 4     # differences in a label


def draw(state: AppState, actions: Actions) -> None:
    """The part of the panel."""
    if state.other is None:
        if imgui.button("Keep as B (Ctrl+B)"):
            actions.keep_settings()
        widgets.hint("The settings of now stay as B, right of a divider; those that are changed from then on are A. It "
                     "takes graphics memory for a second renderer.")
        return
    if imgui.button("Swap"):
        actions.swap_settings()
    imgui.same_line()
    if imgui.button("End"):
        actions.keep_settings()
        return
    if state.reference != "off":
        widgets.muted("A reference is shown in place of B.")
    found = actions.other.differences()
    if not found:
        widgets.muted("A and B are alike: change a setting.")
    elif imgui.begin_table("differences", 3, imgui.TableFlags_.row_bg):
        for name in ("", "A", "B"):
            imgui.table_setup_column(name)
        imgui.table_headers_row()
        for name, a, b in found:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(widgets.title_of(name))
            for value in (a, b):
                imgui.table_next_column()
                imgui.text_unformatted(_value(value))
        imgui.end_table()


def draw_overlay(state: AppState, other: OtherSettings, left: float, top: float, bottom: float) -> float:
    """Divider and labels; arguments and result as of `reference.draw_overlay`."""
    if not other.shown:
        return bottom
    display, em = imgui.get_io().display_size, imgui.get_font_size()
    split.divider(state, top, bottom)
    edge = max(state.split * display.x, left)
    found, times = other.differences(), other.milliseconds
    named = [(widgets.title_of(name), _value(a), _value(b)) for name, a, b in found[:_MOST_NAMED]]
    more = [f"and {len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
    free = bottom
    for side, place, pivot in ((0, edge - 0.6 * em, 1.0), (1, edge + 0.6 * em, 0.0)):
        head = "AB"[side]
        if times is not None:
            head += f"   {times[side]:.1f} ms"
            if side:
                head += f"   ({times[1] - times[0]:+.1f} ms)"
        lines = [head, *(f"{name}: {values[side]}" for name, *values in named), *more]
        free = min(free, split.label("AB"[side], "\n".join(lines), (place, bottom - 0.6 * em), (pivot, 1.0)))
    return free


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
