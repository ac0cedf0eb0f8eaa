"""The help (F1) and the about box; the text of the help is the table of keys."""

from __future__ import annotations

from imgui_bundle import imgui

from ssil_viewer import __version__
from ssil_viewer.app import keys, theme
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.gpu.context import Capabilities


def draw(state: AppState, left: float) -> None:
    """All keys and mouse actions.

    Args:
        left: Where the image begins to be seen, in window units.
    """
    if not state.help_open:
        return
    _place_in_the_middle(56.0, 46.0, left)
    shown, still_open = imgui.begin("Keys and mouse", True, imgui.WindowFlags_.no_collapse)
    state.help_open = bool(still_open)
    if shown:
        for group, bindings in keys.groups():
            imgui.separator_text(group)
            if not imgui.begin_table(group, 2, imgui.TableFlags_.row_bg):
                continue
            imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_stretch, 0.34)
            imgui.table_setup_column("text", imgui.TableColumnFlags_.width_stretch, 0.66)
            for binding in bindings:
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.push_style_color(imgui.Col_.text, theme.ACCENT)
                imgui.text_wrapped(binding.keys)
                imgui.pop_style_color()
                imgui.table_next_column()
                imgui.text_wrapped(binding.text)
            imgui.end_table()
    imgui.end()


def draw_about(state: AppState, capabilities: Capabilities, left: float) -> None:
    """Version, and what OpenGL runs on; `left` as in `draw`."""
    if not state.about_open:
        return
    _place_in_the_middle(34.0, 15.0, left)
    shown, still_open = imgui.begin("About", True, imgui.WindowFlags_.no_collapse)
    state.about_open = bool(still_open)
    if shown:
        imgui.text(f"ssil-viewer {__version__}")
        widgets.muted("Hierarchical screen-space indirect lighting after Soler, Hoel and Rochet, SIGGRAPH 2010.")
        imgui.separator()
        imgui.text_wrapped(capabilities.renderer)
        imgui.text_wrapped(f"OpenGL {capabilities.version}")
        widgets.muted("Compute shaders" if capabilities.compute else "Fragment shaders (compute needs OpenGL 4.3)")
        if capabilities.software:
            widgets.complaint("Software OpenGL: the CPU draws everything. Expect a few frames per second; the "
                              "preset \"fast\" or a smaller image scale helps.")
    imgui.end()


def _place_in_the_middle(width_em: float, height_em: float, left: float) -> None:
    """Place the next window over the visible part of the image; sizes are multiples of the text size."""
    display, em = imgui.get_io().display_size, imgui.get_font_size()
    size = min(width_em * em, 0.95 * (display.x - left)), min(height_em * em, 0.86 * display.y)
    imgui.set_next_window_size(size, imgui.Cond_.appearing)
    imgui.set_next_window_pos(((left + display.x) / 2, display.y / 2), imgui.Cond_.appearing, (0.5, 0.5))
