"""The reference: which one, how far it is, the numbers, the divider, and the scale of the error's colours."""

from __future__ import annotations

from typing import get_args

from imgui_bundle import ImVec2, ImVec4, imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import split, widgets
from ssil_viewer.app.reference import WindowReference
from ssil_viewer.app.state import AppState, ReferenceKind
from ssil_viewer.reference.gpu_pictures import Scale

CHOICES: dict[ReferenceKind, str] = {"off": "None", "R1": "R1: sum over all texels",
                                     "R2": "R2: sum as far as rays see"}
"""As a menu names them."""

_SCALE_EM = (15.0, 0.9)
_LABEL_EM = 4.6     # height that the labels take at the bottom


def draw(state: AppState, actions: Actions) -> None:
    """The part of the panel."""
    reference = actions.reference
    widgets.label("Compare with (R)", "R1: the sum over all texels of the starting level, nothing in between. R2: the "
                  "same as far as rays against the scene's triangles see it. Both have one bounce, and so has the "
                  "picture meanwhile.")
    chosen = widgets.choice("reference", state.reference, get_args(ReferenceKind))
    if chosen != state.reference:
        actions.set_reference(chosen)
    if state.reference == "off":
        return
    widgets.label("Show (V)", "The image under the reference's light, or how far our irradiance is from it.")
    state.reference_view = widgets.choice("view", state.reference_view, ("image", "error"))
    widgets.label("Beside ours (K)", "Our image left of a divider that can be dragged.")
    state.split_view = imgui.checkbox("##split", state.split_view)[1]
    if state.reference_view == "error":
        _error_settings(state)
    _progress(reference)
    _numbers(reference)
    if state.buffer is not None:
        widgets.muted("A buffer is shown in place of the image: choose image under Buffers.")


def _error_settings(state: AppState) -> None:
    widgets.label("Scale ends at", "Error at the end of the colours, as a share of the reference's mean.")
    percent = imgui.slider_float("##limit", 100 * state.error_limit, 1.0, 400.0, "%.0f %%",
                                 imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.logarithmic)[1]
    state.error_limit = percent / 100
    widgets.label("Signed", "Blue is too dark and red too bright; otherwise how much, either way.")
    state.error_signed = imgui.checkbox("##signed", state.error_signed)[1]
    widgets.label("Of 8x8 pixels", "Errors of means of 8x8 pixels, as in the numbers: without the noise of pixels.")
    state.error_blocks = imgui.checkbox("##blocks", state.error_blocks)[1]


def progress_text(reference: WindowReference) -> str:
    """How far it is, in a few words."""
    sums = reference.sums
    if sums is None:
        return "sorting triangles" if reference.preparing else "waiting"
    text = f"{100 * sums.progress:.0f} %, {sums.senders_seen:,} senders"
    return text + (f", {sums.rays_done:,} rays a pixel" if sums.kind == "R2" else " a pixel")


def _progress(reference: WindowReference) -> None:
    share = reference.sums.progress if reference.sums is not None else 0.0
    imgui.progress_bar(share, (-1.0, 0.4 * imgui.get_font_size()), "")
    widgets.muted(progress_text(reference))


def _numbers(reference: WindowReference) -> None:
    found = reference.numbers
    if found is None:
        return
    rows = (("bias", _percent(found.bias)), ("relative RMSE", _number(found.relative_rmse)),
            ("correlation", _number(found.correlation)), ("mean of the reference", f"{found.mean:.4g} W/m²"))
    if imgui.begin_table("numbers", 2, imgui.TableFlags_.row_bg):
        for name, value in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(name)
            imgui.table_next_column()
            widgets.right_aligned(value)
        imgui.end_table()
    widgets.muted("Irradiance of one bounce, over means of 8x8 pixels"
                  + ("" if reference.sums is None or reference.sums.done else "; not yet done") + ".")


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:+.1%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


# -- over the image ----------------------------------------------------------------------------------------------------

def draw_overlay(state: AppState, reference: WindowReference, left: float, top: float, bottom: float) -> float:
    """Divider, labels and scale.

    Args:
        left, top, bottom: Edges of the image that the panels leave free, in window units.

    Returns:
        Above what the messages have to stay, so that nothing of it is covered.
    """
    if not reference.shown:
        return bottom
    display, em = imgui.get_io().display_size, imgui.get_font_size()
    edge, free = left, bottom
    if state.split_view:
        edge = max(state.split * display.x, left)
        split.divider(state, top, bottom)
        free = split.label("ours", "ours", (edge - 0.6 * em, bottom - 0.6 * em), (1.0, 1.0))
    name = f"error against {state.reference}" if state.reference_view == "error" else state.reference
    found = reference.numbers
    numbers = f"\nbias {_percent(found.bias)}, relative RMSE {_number(found.relative_rmse)}" if found else ""
    text = f"{name}   {progress_text(reference)}{numbers}"
    free = min(free, split.label("theirs", text, (edge + 0.6 * em, bottom - 0.6 * em), (0.0, 1.0)))
    if state.reference_view == "error":
        free = min(free, _scale(reference.scale, (display.x - 0.6 * em, bottom - _LABEL_EM * em)))
    return free


def _scale(scale: Scale, corner: tuple[float, float]) -> float:
    """The colours with their numbers; `corner` is its lower right one. Returns its upper edge."""
    em = imgui.get_font_size()
    width, height = (size * em for size in _SCALE_EM)
    imgui.set_next_window_pos(corner, imgui.Cond_.always, (1.0, 1.0))
    imgui.set_next_window_bg_alpha(0.85)
    imgui.begin("##scale", None, split.OVERLAY | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_inputs)
    imgui.text_unformatted("ours - reference, of its mean" if scale.signed else "|ours - reference|, of its mean")
    commands, at = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
    margin = 1.6 * em       # room for the numbers at both ends
    colors = [imgui.get_color_u32(ImVec4(*stop, 1.0)) for stop in scale.stops]
    step = width / (len(colors) - 1)
    for index in range(len(colors) - 1):
        a, b = colors[index], colors[index + 1]
        x = at.x + margin + index * step
        commands.add_rect_filled_multi_color(ImVec2(x, at.y), ImVec2(x + step, at.y + height), a, b, b, a)
    for index, value in enumerate(scale.values):
        text = f"{value:+.0%}" if scale.signed else f"{value:.0%}"
        x = at.x + margin + index * step - imgui.calc_text_size(text).x / 2
        commands.add_text(ImVec2(x, at.y + 1.2 * height), imgui.get_color_u32(imgui.Col_.text), text)
    imgui.dummy((width + 2 * margin, 1.2 * height + em))
    top = imgui.get_window_pos().y
    imgui.end()
    return top
